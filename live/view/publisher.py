"""One thread that draws into one rerun stream, behind a queue that never blocks its callers.

Measurements and pictures: the newest wins, what was passed over is counted. Load samples and
events: all of them, up to a bound, beyond which the oldest go and are counted. A trouble inside
rerun (or a viewer so frozen that rerun waits for it) ends this publisher alone.
"""

from __future__ import annotations

import logging
import threading
from collections import deque
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:
    from acquire.events import Event
    from acquire.frame import Frame
    from live.measure import Measurement

_log = logging.getLogger(__name__)

_DEPTH, _LOADS, _EVENTS = 2, 20_000, 1000


class Drawing(Protocol):
    """What the publisher calls, always on its own thread (``scene.Scene``)."""

    def begin(self) -> None: ...
    def picture(self, frame: Frame) -> None: ...
    def measurement(self, measurement: Measurement) -> None: ...
    def points(self, points: list[tuple[float, float]]) -> None: ...
    def loads(self, samples: list[tuple[float, float]]) -> None: ...
    def event(self, event: Event) -> None: ...
    def status(self, markdown: str) -> None: ...
    def end(self) -> None: ...


@dataclass(slots=True, eq=False)
class _Waiting:
    """What has come since the thread last looked."""

    measurements: deque[Measurement] = field(default_factory=lambda: deque(maxlen=_DEPTH))
    loads: deque[tuple[float, float]] = field(default_factory=lambda: deque(maxlen=_LOADS))
    points: deque[tuple[float, float]] = field(default_factory=lambda: deque(maxlen=_LOADS))
    events: deque[Event] = field(default_factory=lambda: deque(maxlen=_EVENTS))
    picture: Frame | None = None
    status: str | None = None

    def any(self) -> bool:
        few = self.picture or self.status is not None
        return bool(self.measurements or self.loads or self.points or self.events or few)


class Publisher:
    """Draws what it is given, on a thread of its own.

    Parameters
    ----------
    name : str
        Of the place drawn to, for messages.
    drawing : Drawing
    """

    def __init__(self, name: str, drawing: Drawing) -> None:
        self.name, self._drawing = name, drawing
        self.skipped = 0
        self.dropped = 0
        self.failed: str | None = None
        self._waiting, self._stopping = _Waiting(), False
        self._changed = threading.Condition()
        self._thread = threading.Thread(target=self._run, name=f"view {name}", daemon=True)
        self._thread.start()

    def measurement(self, measurement: Measurement) -> None:
        """Offer a measurement; the oldest waiting one gives way."""
        with self._changed:
            self.skipped += len(self._waiting.measurements) == _DEPTH
            self._waiting.measurements.append(measurement)
            self._changed.notify()

    def picture(self, frame: Frame) -> None:
        """Offer a picture; one still waiting gives way."""
        with self._changed:
            self._waiting.picture = frame
            self._changed.notify()

    def load(self, t: float, force: float) -> None:
        """Offer a load sample. The thread is not woken for it: it comes along with the next."""
        with self._changed:
            self.dropped += len(self._waiting.loads) == _LOADS
            self._waiting.loads.append((t, force))

    def event(self, event: Event) -> None:
        """Offer an event."""
        with self._changed:
            self.dropped += len(self._waiting.events) == _EVENTS
            self._waiting.events.append(event)
            self._changed.notify()

    def status(self, markdown: str) -> None:
        """Offer a new text of the status card."""
        with self._changed:
            self._waiting.status = markdown
            self._changed.notify()

    def point(self, strain: float, force: float) -> None:
        """Offer a point of the curve; like a load sample it wakes nobody."""
        with self._changed:
            self.dropped += len(self._waiting.points) == _LOADS
            self._waiting.points.append((strain, force))

    def close(self, timeout_s: float) -> bool:
        """Draw what waits and end; False where the thread is stuck inside rerun."""
        with self._changed:
            self._stopping = True
            self._changed.notify()
        self._thread.join(timeout_s)
        if not self._thread.is_alive():
            return True
        self.failed = self.failed or f"{self.name}: did not take its data in time and was left behind"
        return False

    def _run(self) -> None:
        try:
            self._drawing.begin()
            while (waiting := self._take()) is not None:
                self._draw(waiting)
            self._drawing.end()
        except BaseException as error:  # a panic inside rerun is not an Exception
            self.failed = f"{self.name}: stopped by a trouble in rerun ({error}); all else goes on"
            _log.exception("the view's %s stopped", self.name)

    def _take(self) -> _Waiting | None:
        with self._changed:
            # The time-out is there for load samples alone, which wake nobody.
            while not (self._waiting.any() or self._stopping):
                self._changed.wait(0.1)
            if not self._waiting.any():
                return None
            taken, self._waiting = self._waiting, _Waiting()
            return taken

    def _draw(self, waiting: _Waiting) -> None:
        drawing: Any = self._drawing
        if waiting.loads:
            drawing.loads(list(waiting.loads))
        if waiting.points:
            drawing.points(list(waiting.points))
        for event in waiting.events:
            drawing.event(event)
        if waiting.picture is not None:
            drawing.picture(waiting.picture)
        for measurement in waiting.measurements:
            drawing.measurement(measurement)
        if waiting.status is not None:
            drawing.status(waiting.status)
