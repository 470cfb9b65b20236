"""Bursts: frames averaged in one pass, motion within them (smear), dark and flat frames."""

from acquire.burst.accumulate import LIMIT_PX, BurstAccumulator, average_bursts, burst_of, compile_loops
from acquire.burst.flat_field import FlatField, load_mean, save_mean
from acquire.burst.memory import PictureMemory
from acquire.burst.summed import SumAccumulator, SummedBurst, nothing_clipped, sum_kind

__all__ = [
    "LIMIT_PX",
    "BurstAccumulator",
    "FlatField",
    "PictureMemory",
    "SumAccumulator",
    "SummedBurst",
    "average_bursts",
    "burst_of",
    "compile_loops",
    "load_mean",
    "nothing_clipped",
    "save_mean",
    "sum_kind",
]
