"""The one measuring path, live and in a replay: no thread, file, device or clock.

``preparation`` makes a kernel of a reference burst (``reference``), ``pipeline`` measures burst after burst
with a ``tracker``, ``measurement`` is what comes out, ``history`` its means; ``smear`` warns of motion
within a burst.
"""

from live.measure.history import History, Instant
from live.measure.measurement import Measurement
from live.measure.pipeline import NewReference, measure
from live.measure.preparation import (
    Correction,
    averaged,
    frame_noise,
    motion_between,
    prepare,
    unchanged,
    usable,
)
from live.measure.reference import Reference, ReferenceTaker
from live.measure.smear import SmearGuard

__all__ = [
    "Correction",
    "History",
    "Instant",
    "Measurement",
    "NewReference",
    "Reference",
    "ReferenceTaker",
    "SmearGuard",
    "averaged",
    "frame_noise",
    "measure",
    "motion_between",
    "prepare",
    "unchanged",
    "usable",
]
