"""Device to frames, load samples and recordings. Knows nothing of strain or of the screen.

``open_camera`` and ``open_load_cell`` open anything that has an address; ``Frame``, ``Burst``
and ``LoadSample`` are what comes out.
"""
