"""The outputs for a person: ``terminal``, ``rerun`` (maps and curves) and ``web`` (the operator's page)."""
