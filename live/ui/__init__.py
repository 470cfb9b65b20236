"""What a person sees: ``terminal``, ``rerun`` (maps and curves) and ``web`` (the operator's page)."""
