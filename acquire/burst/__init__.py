"""Bursts: frames averaged in one pass, motion within them (smear), dark and flat frames."""

from acquire.burst.accumulate import LIMIT_PX, BurstAccumulator, average_bursts, burst_of, compile_loops
from acquire.burst.flat_field import FlatField, load_mean, save_mean

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
