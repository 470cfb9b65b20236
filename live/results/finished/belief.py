"""Whether the first figures of a test can be believed, as one sentence for page and report."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from acquire.text import Message
from live.results.figures import TensileRow


@dataclass(frozen=True, slots=True)
class Belief:
    """The sentence.

    Attributes
    ----------
    kind : "good", "look" or "bad"
        All figures can be believed, some, or none is known.
    words : str
        Each exception is named.
    more : str
        What their intervals hold; empty where no figure is known.
    """

    kind: Literal["good", "look", "bad"]
    words: str
    more: str = ""


def belief(rows: Sequence[TensileRow], troubles: Sequence[str], limits: str = "") -> Belief:
    """The sentence on the figures ``rows``.

    What the data say against a test (``troubles``) stands against all of its figures. ``limits`` are those of error
    that the interval of E holds beside the scatter, in words (``beyond_scatter``).
    """
    known = [row for row in rows if row.figure.known]
    doubtful = ", ".join(row.name for row in known if row.remark)
    sure = ", ".join(row.name for row in known if not row.remark)
    if not known:
        return Belief("bad", Message("No figure is known; the list says why."))
    held = Message("The intervals (95 %) hold the scatter.")
    if limits:
        held = Message("The intervals (95 %) hold the scatter, that of E also the {limits}.", limits)
    if troubles:
        names = ", ".join(row.name for row in known)
        return Belief("look", Message("Look at the remarks before you believe {names}.", names), held)
    if doubtful and sure:
        return Belief("look", Message("{sure} can be believed; look at {doubtful}.", sure, doubtful), held)
    if doubtful:
        return Belief("look", Message("Look at {doubtful}: each has a remark.", doubtful), held)
    more = Message("The data say nothing against them.")
    return Belief("good", Message("{sure} can be believed.", sure), more + " " + held)
