"""A picture before any ZOI is fitted.

``spectrum`` filters the reference by its signal-to-noise ratio, ``pattern`` judges it, ``splines`` has taps
and prefilter; the compiled ``cutting`` and ``warp`` bring a deformed picture back. Compiled modules are
imported by name.
"""
