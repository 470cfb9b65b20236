"""The view: everything a person watches during a test, drawn by a process of its own.

Drawn in the measuring process it would starve that of the interpreter lock and of a core. So whoever
gives something appends it and goes on; a thread of the view looks twenty times a second (``keeper``),
makes messages of what has come (``supply``) and sends them to ``python -m live.view.drawing``
(``child``, ``wire``). The view measures nothing, and nothing it leaves out is missing from the
recording or the results.
"""

from __future__ import annotations

import math
import uuid
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from live.view.exchange.messages import Where, row_of
from live.view.exchange.setup import ViewSetup
from live.view.exchange.wire import Kind
from live.view.keeper import Keeper, Tell
from live.view.supply import Story, Supply
from live.view.viewer import from_elsewhere, has_display, rerun_command, url
from live.view.waiting import Waiting

if TYPE_CHECKING:
    from acquire.events import Event
    from acquire.frame import Frame
    from live.measure import Measurement, Snapshot

LOAD_STEP_S = 0.02
"""Of load samples that come faster, one in so long is shown."""


class View:
    """Shows a test; no method but ``close`` waits, none raises.

    Parameters
    ----------
    setup : ViewSetup
    port : int or None
        Where viewers connect, on 127.0.0.1; the next free one is taken. None: no server.
    rrd : Path or None
        File for looking at later, never overwritten; a process started anew writes view-2.rrd ...
    tell : callable
        Told, by the view's thread, what a person should know: words and their level.
    serving : callable
        Called, by the view's thread, with this view once viewers can connect, and again where they
        must anew, since the process was.
    story : callable
        Gives messages (``live.view.exchange``) that are all shown, from the beginning, of a finished test.
    """

    def __init__(
        self,
        setup: ViewSetup,
        *,
        port: int | None,
        rrd: Path | None,
        tell: Tell = lambda text, level: None,
        serving: Callable[[View], None] = lambda view: None,
        story: Story = lambda: (),
    ) -> None:
        self._setup, self._waiting = setup, Waiting()
        self._supply = Supply(setup, self._waiting, story)
        where = Where(port, None if rrd is None else str(rrd.absolute()), str(uuid.uuid4()))
        self._keeper = Keeper(self._supply, where, tell, lambda: serving(self))
        self._picture_t = self._load_t = -math.inf
        self._keeper.start()

    # -- what is shown ------------------------------------------------------------------------

    def picture(self, frame: Frame) -> None:
        """Offer a frame; ``picture_hz`` of them are taken per second of the test, at most."""
        if frame.t - self._picture_t >= 0.999 / self._setup.picture_hz:
            self._picture_t = frame.t
            self._waiting.picture = frame

    def show(self, measurement: Measurement) -> None:
        """Offer a measurement: its means are shown, its field where no newer one comes first."""
        self._waiting.row(Kind.MEANS, row_of(measurement))
        self._waiting.field = measurement.t, measurement.field

    def point(self, axial: float, force: float) -> None:
        """Offer a point of the curve: strain along the load, and its final force (N); NaN is not drawn."""
        self._waiting.row(Kind.POINTS, (axial, force))

    def load(self, t: float, force: float) -> None:
        """Offer a load sample (monotonic s, N); 50 a second are shown."""
        if t - self._load_t >= 0.999 * LOAD_STEP_S and math.isfinite(force):
            self._load_t = t
            self._waiting.row(Kind.LOADS, (t, force))

    def event(self, event: Event) -> None:
        """Offer an event."""
        self._waiting.event(event)

    def status(self, text_markdown: str) -> None:
        """Set the status card."""
        self._waiting.status = text_markdown

    def figures(self, snapshot: Snapshot) -> None:
        """Set the large figures."""
        self._waiting.figures = snapshot

    def close(self, seconds: float) -> None:
        """Draw what waits, finish the file and end; a process that takes longer is killed, and it is told."""
        self._keeper.close(seconds)

    # -- what a person or a test asks ---------------------------------------------------------

    @property
    def port(self) -> int | None:
        """Where it is really served; None until it is."""
        return self._keeper.served.port

    @property
    def rrd(self) -> Path | None:
        """The file that is written; None until it is."""
        rrd = self._keeper.served.rrd
        return None if rrd is None else Path(rrd)

    @property
    def pid(self) -> int | None:
        """Of the process that draws, while there is one."""
        return self._keeper.pid

    @property
    def failed(self) -> str:
        """Why the view has ended for good; empty while all is well."""
        return self._keeper.failed

    @property
    def report(self) -> str:
        """What was sent and what was not, in a few words."""
        fields, pictures = (self._supply.sent[kind] for kind in (Kind.FIELD, Kind.PICTURE))
        said = [f"{fields} maps and {pictures} pictures drawn"]
        if self._waiting.dropped:
            said.append(f"{self._waiting.dropped} rows or events dropped")
        if self._keeper.starts > 1:
            said.append(f"its process was started {self._keeper.starts} times")
        return ", ".join(said)

    @property
    def address(self) -> str:
        """How to look, now and later: one line for each way."""
        lines = []
        if self.port is not None:
            lines.append(f"watch: {rerun_command()} --connect {url(self.port)}")
            if not has_display():
                lines.append(f"watch from a machine with a display: {from_elsewhere(self.port)}")
        if self.rrd is not None:
            lines.append(f"later: {rerun_command()} {self.rrd}")
        return "\n".join(lines)
