"""The one clock of a test, and how it hangs together with the calendar.

Everything is stamped in ``time.monotonic()`` seconds; a ``ClockPair`` names the instant of
UTC one of them was, so that a file can be put beside those of other machines.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from datetime import UTC, datetime


@dataclass(frozen=True, slots=True)
class ClockPair:
    """The same instant on both clocks.

    Attributes
    ----------
    monotonic : float, s
    utc : datetime
        With its time zone.
    """

    monotonic: float
    utc: datetime

    @classmethod
    def now(cls) -> ClockPair:
        """Read both clocks, one right after the other."""
        return cls(time.monotonic(), datetime.now(UTC))

    def iso(self) -> str:
        """UTC in ISO 8601 with microseconds: ``2026-05-09T07:35:25.123456Z``."""
        return self.utc.astimezone(UTC).isoformat(timespec="microseconds").replace("+00:00", "Z")

    @classmethod
    def from_iso(cls, monotonic: float, text: str) -> ClockPair:
        """The pair that ``iso`` wrote.

        Raises
        ------
        ValueError
            Not an ISO 8601 time.
        """
        utc = datetime.fromisoformat(text)
        return cls(monotonic, utc if utc.tzinfo else utc.replace(tzinfo=UTC))
