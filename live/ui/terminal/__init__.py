"""Messages and the status line on a terminal."""
