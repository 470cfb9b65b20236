"""Strain maps as pictures: one ``scale`` and range, ``colours``, ``painting``; ``field_maps`` for displays,
``map`` for a file.
"""
