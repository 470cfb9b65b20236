"""Cameras, load cells and recordings: from a device to ``Frame``, ``LoadSample`` and back from a file.

``acquire.camera.open_camera`` and ``acquire.load_cell.open_load_cell`` open any address. ``acquire.session``
records and reads. Nothing is imported here: ``phasedic --help`` needs the errors and does not wait for numpy.
"""
