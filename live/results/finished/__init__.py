"""A finished test: its figures, what its data say against them, and ``figures.json`` for other programs."""
