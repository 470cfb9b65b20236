"""Bursts: frames averaged in one pass, motion within them, dark and flat frames.

``accumulate`` (loops in ``accumulate_loops``) makes a ``Burst`` of frames, ``smear`` (``smear_loops``)
tells how far the picture moved within one, ``flat_field`` takes the fixed pattern of the sensor out,
``mean_image`` keeps dark and flat frames as files.
"""

from acquire.burst.accumulate import BurstAccumulator, average_bursts, burst_of, compile_loops
from acquire.burst.flat_field import FlatField
from acquire.burst.mean_image import load_mean, save_mean
from acquire.burst.smear import LIMIT_PX

__all__ = [
    "LIMIT_PX",
    "BurstAccumulator",
    "FlatField",
    "average_bursts",
    "burst_of",
    "compile_loops",
    "load_mean",
    "save_mean",
]
