"""What has come for the view and was not yet sent; everything bounded, what goes is counted.

Filled by the threads of the test with one append each, emptied by the view's own. Rows are kept
all, of fields and pictures the newest.
"""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, Any

from live.measure import Snapshot, Thinned
from live.view.exchange.messages import Row
from live.view.exchange.wire import Kind

if TYPE_CHECKING:
    from acquire.events import Event
    from acquire.frame import Frame
    from analysis.field import StrainField

MOST_ROWS, MOST_EVENTS = 20_000, 1000
PAST_ROWS = {Kind.MEANS: 5000, Kind.LOADS: 10_000, Kind.POINTS: 800}
"""What is kept of each to be told again."""


class Waiting:
    """What waits to be sent.

    Attributes
    ----------
    rows : mapping of Kind to deque of Row
    events : deque of Event
    field : (t, StrainField) or None
    picture : Frame or None
    status : str or None
        Markdown.
    figures : Snapshot or None
    dropped : int
        Rows and events that were too many.
    """

    def __init__(self) -> None:
        self.rows: dict[Kind, deque[Row]] = {kind: deque() for kind in PAST_ROWS}
        self.events: deque[Event] = deque()
        self.field: tuple[float, StrainField] | None = None
        self.picture: Frame | None = None
        self.status: str | None = None
        self.figures: Snapshot | None = None
        self.dropped = 0

    def row(self, kind: Kind, row: Row) -> None:
        """Keep a row; of too many the oldest goes."""
        self._keep(self.rows[kind], row, MOST_ROWS)

    def event(self, event: Event) -> None:
        """Keep an event; of too many the oldest goes."""
        self._keep(self.events, event, MOST_EVENTS)

    def _keep(self, kept: deque[Any], item: Any, most: int) -> None:
        if len(kept) >= most:
            kept.popleft()
            self.dropped += 1
        kept.append(item)


def taken(kept: deque[Any]) -> list[Any]:
    """All of it, which is then gone from there; another thread may append meanwhile."""
    return [kept.popleft() for _ in range(len(kept))]


class Past:
    """What a process that is started anew must be told: rows thinned, the last events and the status.

    Attributes
    ----------
    rows : mapping of Kind to Thinned
    events : deque of Event
    status : str or None
    """

    def __init__(self) -> None:
        self.rows: dict[Kind, Thinned[Row]] = {kind: Thinned(most) for kind, most in PAST_ROWS.items()}
        self.events: deque[Event] = deque(maxlen=MOST_EVENTS)
        self.status: str | None = None
