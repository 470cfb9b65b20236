"""Picture files: only regular files are opened, and pictures are decoded from memory."""
