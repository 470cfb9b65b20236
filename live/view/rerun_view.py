"""The view: everything a person watches during a test, in rerun.

``RerunView`` serves a running test to any number of viewers on 127.0.0.1, early, late, killed or
frozen, and writes it to an .rrd file. Nothing here ever blocks or raises into the test: each of
the two has a thread, a stream and a queue of its own (``publisher``). What is drawn stands in
``scene``, where it stands on the screen in ``layout``. The view measures nothing, and
nothing it leaves out is missing from the recording or the results.

Rerun's own viewer sends anonymous usage data to its makers unless ``rerun analytics disable`` was
called once; this program sends nothing.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from live.view.publisher import Publisher
from live.view.setup import Rates, ViewSetup
from live.view.viewer import HOST, free_port, rerun_command, spawn_viewer, url

if TYPE_CHECKING:
    from acquire.events import Event
    from acquire.frame import Frame
    from live.measure import Measurement

__all__ = ["RerunView", "ViewSetup", "spawn_viewer"]

_log = logging.getLogger(__name__)

APPLICATION = "phasedic"
SERVER_MIB = 512
"""What a viewer that comes late can still be shown; beyond, the oldest pictures and maps go."""

RRD_LIMIT_BYTES = 1e9

# Streams whose thread is stuck in rerun: taking them down would block, so they stay.
_left_behind: list[Any] = []


class RerunView:
    """Shows a test; no method blocks or raises.

    Parameters
    ----------
    setup : ViewSetup
    port : int or None
        Where viewers connect, on 127.0.0.1; the next free one is taken (``.port`` tells).
        None: no server.
    rrd : Path or None
        File for looking at later, never overwritten; pictures at 1 Hz, maps at 2 Hz, and none
        any more after ``RRD_LIMIT_BYTES``.

    Attributes
    ----------
    port : int or None
    rrd : Path or None
    """

    def __init__(self, setup: ViewSetup, *, port: int | None, rrd: Path | None) -> None:
        self._setup = setup
        self._picture_t = -math.inf
        self._troubles: list[str] = []
        self._publishers: list[Publisher] = []
        self.port = None if port is None else self._guarded("server", lambda: self._serve(port))
        self.rrd = None if rrd is None else self._guarded("file", lambda: self._write_to(rrd))

    # -- what is shown ------------------------------------------------------------------------

    def picture(self, frame: Frame) -> None:
        """Offer a frame; ``picture_hz`` of them are taken per second of the test."""
        if frame.t - self._picture_t >= 0.999 / self._setup.picture_hz:
            self._picture_t = frame.t
            self._each(lambda p: p.picture(frame))

    def show(self, measurement: Measurement) -> None:
        """Offer a measurement; the newest win."""
        self._each(lambda p: p.measurement(measurement))

    def settled(self, measurement: Measurement) -> None:
        """Offer a point of the curve: a measurement whose force is final."""
        strain = measurement.instant.eyy if self._setup.axis == "y" else measurement.instant.exx
        self._each(lambda p: p.point(strain, measurement.force))

    def load(self, t: float, force: float) -> None:
        """Offer a load sample (monotonic s, N)."""
        self._each(lambda p: p.load(t, force))

    def event(self, event: Event) -> None:
        """Offer an event."""
        self._each(lambda p: p.event(event))

    def status(self, text_markdown: str) -> None:
        """Set the status card."""
        self._each(lambda p: p.status(text_markdown))

    def close(self, timeout_s: float = 5.0) -> None:
        """Draw what waits, finish the file and end; what is stuck is left behind and told."""
        for publisher in self._publishers:
            if not publisher.close(timeout_s):
                _leave_behind(publisher)

    # -- what a person or a test asks ------------------------------------------------------------

    @property
    def skipped(self) -> int:
        """Measurements not drawn because newer ones came first (the most of any place)."""
        return max((p.skipped for p in self._publishers), default=0)

    @property
    def dropped(self) -> int:
        """Load samples and events not drawn because too many waited."""
        return max((p.dropped for p in self._publishers), default=0)

    @property
    def failed(self) -> str | None:
        """What went wrong, for a person; None while all is well."""
        troubles = [*self._troubles, *(p.failed for p in self._publishers if p.failed)]
        return "; ".join(troubles) or None

    @property
    def address(self) -> str:
        """How to look, now and later: one line for each way."""
        lines = []
        if self.port is not None:
            lines.append(f"watch: {rerun_command()} --connect {url(self.port)}")
        if self.rrd is not None:
            lines.append(f"later: {rerun_command()} {self.rrd}")
        return "\n".join(lines)

    # -- the two places -------------------------------------------------------------------------

    def _serve(self, wanted: int) -> int:
        import rerun as rr

        port = free_port(wanted)
        if port is None:
            raise OSError(f"no free port from {wanted} on; set another view.port")
        if port != wanted:
            _log.warning("port %d is taken; the view is on %d", wanted, port)
        sink = rr.GrpcServerSink(HOST, port, server_memory_limit=f"{SERVER_MIB}MiB")
        rates = Rates(self._setup.picture_hz, 10.0, 80, 1280, repeat_bytes=SERVER_MIB * 2**20 / 4)
        self._publish(f"server on port {port}", sink, rates)
        return port

    def _write_to(self, path: Path) -> Path:
        import rerun as rr

        if path.exists():
            raise OSError(f"{path} exists already and is not overwritten")
        rates = Rates(1.0, 2.0, 80, 1280, limit_bytes=RRD_LIMIT_BYTES)
        self._publish(str(path), rr.FileSink(str(path)), rates)
        return path

    def _publish(self, name: str, sink: Any, rates: Rates) -> None:
        import rerun as rr

        from live.view.layout import blueprint
        from live.view.scene import Scene

        stream = rr.RecordingStream(APPLICATION)
        stream.set_sinks(sink)
        stream.send_recording_name(self._setup.title)
        stream.send_blueprint(blueprint(self._setup))
        self._publishers.append(Publisher(name, Scene(stream, self._setup, rates)))

    def _guarded(self, what: str, step: Callable[[], Any]) -> Any:
        try:
            return step()
        except Exception as error:
            self._troubles.append(f"the view's {what} did not start: {error}; all else goes on")
            _log.warning("the view's %s did not start: %s", what, error, exc_info=True)
            return None

    def _each(self, offer: Callable[[Publisher], None]) -> None:
        for publisher in self._publishers:
            if publisher.failed is None:
                offer(publisher)


def _leave_behind(publisher: Publisher) -> None:
    import rerun as rr

    _log.warning("%s", publisher.failed)
    _left_behind.append(publisher)
    rr.unregister_shutdown()  # else the end of the program waits for the stuck stream
