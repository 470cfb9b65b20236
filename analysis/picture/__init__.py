"""A picture before any ZOI is fitted: spectrum, pattern, splines, warp.

``spectrum`` filters the reference by its own signal-to-noise, ``pattern`` judges it, ``splines`` has the
taps; the compiled ``prefilter``, ``cutting`` and ``warp`` bring a deformed picture back. Compiled modules
are imported by their own names: this face loads no numba.
"""

from analysis.picture.pattern import (
    PatternReport,
    autocorrelation_fwhm,
    describe_pattern,
    noise_of_picture,
    predicted_sigma,
    resolution_length,
)
from analysis.picture.spectrum import Pattern, filtered_pattern
from analysis.picture.splines import LINE, PAD, TAPS, Box, prefilter_taps, tap_table

__all__ = [
    "LINE",
    "PAD",
    "TAPS",
    "Box",
    "Pattern",
    "PatternReport",
    "autocorrelation_fwhm",
    "describe_pattern",
    "filtered_pattern",
    "noise_of_picture",
    "predicted_sigma",
    "prefilter_taps",
    "resolution_length",
    "tap_table",
]
