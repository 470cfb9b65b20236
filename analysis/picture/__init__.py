"""A picture before any ZOI is fitted.

``spectrum`` filters the reference by its signal-to-noise ratio, ``pattern`` judges it, ``splines`` has the
taps; the compiled ``prefilter``, ``cutting`` and ``warp`` bring a deformed picture back. Compiled modules are
imported by name.
"""
