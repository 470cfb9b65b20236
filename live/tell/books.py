"""What is kept of a test while it runs."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from acquire.load_cell import LoadLog
from live.measure import History, Instant, Snapshot, strains_along
from live.setup import SpecimenConfig
from live.tell.board import AlarmBoard, Vitals
from live.tell.journal import Journal
from live.tell.ledger import Ledger


@dataclass(frozen=True, slots=True, eq=False)
class Books:
    """Events, counts of frames, loads and means, each filled by whoever knows.

    Attributes
    ----------
    journal : Journal
    ledger : Ledger
    loads : LoadLog
    history : History
    alarms : AlarmBoard
    vitals : Vitals
    specimen : SpecimenConfig
    """

    journal: Journal
    ledger: Ledger
    loads: LoadLog
    history: History
    alarms: AlarmBoard = field(default_factory=AlarmBoard)
    vitals: Vitals = field(default_factory=Vitals)
    specimen: SpecimenConfig = field(default_factory=SpecimenConfig)

    @classmethod
    def new(cls, max_gap_s: float, lag_s: float = 0.0, specimen: SpecimenConfig | None = None) -> Books:
        """Empty ones; ``max_gap_s`` and ``lag_s`` (s) as for ``LoadLog``."""
        specimen = specimen or SpecimenConfig()
        loads, history = LoadLog(max_gap_s, lag_s), History(specimen.axis)
        return cls(Journal(), Ledger(), loads, history, specimen=specimen)

    def snapshot(self, t: float, instant: Instant | None = None) -> Snapshot:
        """Where the test stands at ``t`` (s, monotonic), with ``instant`` or else the last that was measured.

        The force is the newest of the load cell; in a replay, and before the first sample, that of the instant.
        """
        if instant is None and self.history.instants:
            instant = self.history.instants[-1]
        vitals, area, axis = self.vitals, self.specimen.area_m2, self.history.axis_by_now
        sample = self.loads.latest if vitals.state else None
        force = math.nan if instant is None else instant.force
        if sample is not None:
            force = sample.force
        axial, sigma = instant.axial(axis) if instant else (math.nan, math.nan)
        return Snapshot(
            t=t,
            state=vitals.state or "REPLAY",
            elapsed_s=t - vitals.began_t,
            fps=vitals.fps,
            force_N=force,
            stress_Pa=force / area if area else math.nan,
            peak_N=vitals.peak_N,
            axial_name=strains_along(instant.gauges if instant else (), axis)[0],
            axial=axial,
            sigma_axial=sigma,
            valid=instant.n_valid if instant else 0,
            zois=instant.n_zoi if instant else 0,
            latency_p95_s=vitals.latency_p95_s,
            disk_s=vitals.disk_s,
            alarms=self.alarms.texts,
            frames=self.ledger.as_dict(),
            instant=instant,
        )
