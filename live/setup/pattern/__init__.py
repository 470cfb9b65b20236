"""The accuracy that one's own pattern allows, and the spectrum of one ZOI.

``own_pattern`` imposes known deformations on a picture (``imposed``) and writes an ``outcome`` as a ``page``.
``spectrum`` is of one ZOI.
"""
