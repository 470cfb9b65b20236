"""Bursts: frames averaged in one pass, motion within them (smear), dark and flat frames."""

from acquire.burst.accumulate import LIMIT_PX, BurstAccumulator, average_bursts, burst_of, compile_loops
from acquire.burst.flat_field import FlatField, load_mean, save_mean
from acquire.burst.memory import PictureMemory

__all__ = [
    "LIMIT_PX",
    "BurstAccumulator",
    "FlatField",
    "PictureMemory",
    "average_bursts",
    "burst_of",
    "compile_loops",
    "load_mean",
    "save_mean",
]
