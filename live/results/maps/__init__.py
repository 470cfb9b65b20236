"""Strain maps as pictures: ``colours``, ``scale`` (range and unit), ``painting`` of files and during a test."""
