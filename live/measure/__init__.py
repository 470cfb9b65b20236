"""The one measuring path, live and in a replay: no thread, file, device or clock.

``preparation`` makes a kernel of a reference burst (``reference``), ``pipeline`` measures burst after burst
with a ``tracker``, ``measurement`` is what comes out with its means (``instant``, kept in ``history`` and ``kept``),
``settling`` waits for its force, ``snapshot`` is where a test stands, ``screen`` where a person reads it;
``guards`` warn of motion within a burst and of strains that are no longer small.
"""

from live.measure.guards import SmearGuard
from live.measure.history import AxisFinder, History
from live.measure.instant import AXIAL, TRANSVERSE, Instant, ordered_mean, strains_along
from live.measure.measurement import Measurement
from live.measure.pipeline import NewReference, measure
from live.measure.preparation import (
    Correction,
    averaged,
    frame_noise,
    motion_between,
    on_fit_machine,
    prepare,
    unchanged,
    usable,
)
from live.measure.reference import Reference, ReferenceTaker
from live.measure.rehearsal import kinds_of, rehearse
from live.measure.screen import Screen
from live.measure.settling import HOLD_S, Loads, Settling
from live.measure.snapshot import Snapshot, peak_force
from live.measure.thinned import Thinned

__all__ = [
    "AXIAL",
    "HOLD_S",
    "TRANSVERSE",
    "AxisFinder",
    "Correction",
    "History",
    "Instant",
    "Loads",
    "Measurement",
    "NewReference",
    "Reference",
    "ReferenceTaker",
    "Screen",
    "Settling",
    "SmearGuard",
    "Snapshot",
    "Thinned",
    "averaged",
    "frame_noise",
    "kinds_of",
    "measure",
    "motion_between",
    "on_fit_machine",
    "ordered_mean",
    "peak_force",
    "prepare",
    "rehearse",
    "strains_along",
    "unchanged",
    "usable",
]
