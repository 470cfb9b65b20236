"""What is kept of a test while it runs."""

from __future__ import annotations

from dataclasses import dataclass, field

from acquire.load_cell import LoadLog
from live.measure import History
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
    """

    journal: Journal
    ledger: Ledger
    loads: LoadLog
    history: History
    alarms: AlarmBoard = field(default_factory=AlarmBoard)
    vitals: Vitals = field(default_factory=Vitals)

    @classmethod
    def new(cls, max_gap_s: float, lag_s: float = 0.0) -> Books:
        """Empty ones; ``max_gap_s`` and ``lag_s`` (s) as for ``LoadLog``."""
        return cls(Journal(), Ledger(), LoadLog(max_gap_s, lag_s), History())
