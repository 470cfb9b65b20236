"""Why a ZOI has a value, or has none."""

from __future__ import annotations

from enum import IntEnum


class Status(IntEnum):
    """Whether a ZOI has a value, and why not; files store the numbers."""

    OK = 0
    NOT_MEASURED = 1
    NO_PATTERN = 2
    CLIPPED = 3
    OUTSIDE = 4
    LOST = 5
    NOT_CONVERGED = 6
    POOR_MATCH = 7
    UNEVEN = 8
    AMBIGUOUS = 9

    @property
    def text(self) -> str:
        """The status in words for a person."""
        return _TEXTS[self]


_TEXTS = {
    Status.OK: "measured",
    Status.NOT_MEASURED: "not asked for (outside the mask or switched off)",
    Status.NO_PATTERN: "too little pattern to measure on",
    Status.CLIPPED: "saturated pixels: reduce exposure or light",
    Status.OUTSIDE: "moved out of the picture",
    Status.LOST: "the pattern was not found again",
    Status.NOT_CONVERGED: "the iteration did not settle",
    Status.POOR_MATCH: "the picture does not fit the reference here (crack, edge, glare or blur)",
    Status.UNEVEN: "the displacement jumps or bends inside the ZOI (crack, edge, steep strain): take smaller ZOIs",
    Status.AMBIGUOUS: "the pattern repeats, and nothing decides where this is: smaller steps between pictures",
}
