"""What is kept of a test while it runs."""

from __future__ import annotations

from dataclasses import dataclass

from acquire.load_cell import LoadLog
from live.measure import History
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
    """

    journal: Journal
    ledger: Ledger
    loads: LoadLog
    history: History

    @classmethod
    def new(cls, max_gap_s: float) -> Books:
        """Empty ones; ``max_gap_s`` (s) as for ``LoadLog``."""
        return cls(Journal(), Ledger(), LoadLog(max_gap_s), History())
