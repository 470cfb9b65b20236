"""Device to frames, load samples and recordings. Knows nothing of strain or of the screen.

``acquire.camera.open_camera`` and ``acquire.load_cell.open_load_cell`` open anything that has an address;
``Frame`` and ``Burst`` of ``acquire.frame`` and ``LoadSample`` of ``acquire.load_sample`` are what comes
out, ``acquire.session`` keeps them. Nothing is imported here, since ``phasedic --help`` needs the errors
and must not wait for numpy.
"""
