"""The recording of a run: what is chosen, kept before the start, and written."""
