"""Strain maps as pictures: ``colours``, ``scale`` (range and unit), ``painting``; ``field_maps`` during a test,
``map`` as a file.
"""
