"""The view: everything a person watches during a test, drawn by a process of its own.

Drawn in the measuring process it would starve that of the interpreter lock and of a core. So whoever
gives something appends it and goes on; a thread of the view looks twenty times a second (``keeper``),
makes messages of what has come (``supply``) and sends them to ``python -m live.ui.rerun.drawing``
(``child``, ``wire``). The view measures nothing, and nothing it leaves out is missing from the
recording or the results.

The viewer as a program of its own: found, started where there is a display, never waited for.

It loads the libraries of the display when it starts, and ends at once where one is missing: a thread sees that.
"""

from __future__ import annotations

import importlib.util
import logging
import math
import os
import re
import socket
import subprocess
import sys
import tempfile
import threading
import uuid
from collections.abc import Callable
from pathlib import Path
from typing import IO, TYPE_CHECKING

from live.ui.rerun.messages import ViewSetup, ViewTarget, row_of
from live.ui.rerun.outbox import MessageSource, Outbox, Pending
from live.ui.rerun.supervisor import Notify, Supervisor
from live.ui.rerun.wire import Kind

if TYPE_CHECKING:
    from acquire.events import Event
    from acquire.frame import Frame
    from live.pipeline.measurement import Measurement
    from live.pipeline.snapshot import Snapshot

_log = logging.getLogger(__name__)

HOST = "127.0.0.1"
VIEWER_PACKAGES = "apt install libx11-xcb1 libxcursor1 libxi6 libxkbcommon-x11-0 mesa-vulkan-drivers"
"""What brings the libraries of a window and of drawing in it to a Debian without desktop."""

_OPENING_S = 10.0
_ANSI_CODES, _OS_ERROR = re.compile(r"\x1b\[[0-9;]*m"), re.compile(r"os error at \S+ ")


def url(port: int) -> str:
    """The address a viewer connects to."""
    return f"rerun+http://{HOST}:{port}/proxy"


def remote_access(port: int) -> str:
    """How to watch on a machine with a display what is served on this one, to which nothing else may connect."""
    return f"ssh -N -L {port}:{HOST}:{port} {socket.gethostname()}, and there: rerun --connect {url(port)}"


def viewer_binary() -> Path | None:
    """The viewer that came with the SDK; not looked for on PATH, where a venv often is not."""
    spec = importlib.util.find_spec("rerun_cli")
    if spec is None or spec.origin is None:
        return None
    folder = Path(spec.origin).parent
    names = ("Rerun.app/Contents/MacOS/Rerun", "rerun", "rerun.exe")
    return next((folder / name for name in names if (folder / name).is_file()), None)


def has_display() -> bool:
    """Whether a window can be opened from here."""
    return sys.platform == "darwin" or any(os.environ.get(k) for k in ("DISPLAY", "WAYLAND_DISPLAY"))


def spawn_viewer(
    port: int, notify: Callable[[str], None] = lambda text: None, memory_limit: str = "2GB"
) -> subprocess.Popen[bytes] | None:
    """Open a viewer window on the view at ``port``.

    Parameters
    ----------
    port : int
    tell : callable
        Told, by a thread, why no window came: one sentence, where the viewer ends with an error as it starts.
    memory_limit : str
        Of the viewer; beyond it the oldest data go. Its own default is 75 % of all memory.

    Returns
    -------
    Popen or None
        None without a display or without the viewer's program, or when it cannot start.
    """
    binary = viewer_binary()
    if binary is None or not has_display():
        return None
    command = [str(binary), "--connect", url(port), "--memory-limit", memory_limit, "--hide-welcome-screen"]
    # A file and no pipe: the viewer may outlive us, and must not fail at words that nobody reads.
    words = tempfile.TemporaryFile()  # noqa: SIM115 - closed by the thread
    try:
        # A session of its own: Ctrl-C in our terminal is not meant for the viewer.
        process = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=words,
            start_new_session=True,
        )
    except OSError as error:
        words.close()
        _log.warning("the viewer %s did not start: %s", binary, error)
        return None
    threading.Thread(target=_watch_start, args=(process, words, notify), name="viewer", daemon=True).start()
    return process


def _watch_start(process: subprocess.Popen[bytes], words: IO[bytes], notify: Callable[[str], None]) -> None:
    """Tell where the viewer ends with an error instead of opening."""
    with words:
        try:
            failed = process.wait(_OPENING_S) > 0  # a signal is somebody's wish
        except subprocess.TimeoutExpired:
            return
        if failed:
            words.seek(0)
            notify(viewer_failure(words.read().decode(errors="replace")))


def viewer_failure(words: str) -> str:
    """The sentence for a viewer that ended as it started, from what it wrote."""
    lines = [line.strip() for line in _ANSI_CODES.sub("", words).splitlines()]
    why = next(
        (line.removeprefix("Error: ") for line in lines if line.startswith("Error: ")), "no reason given"
    )
    return f"the viewer did not open ({_OS_ERROR.sub('', why)}); on a Debian without desktop it needs: {VIEWER_PACKAGES}"


def rerun_command() -> str:
    """How a person calls the viewer from a terminal."""
    beside = Path(sys.executable).with_name("rerun")
    if not beside.is_file():
        return "rerun"
    try:
        return str(beside.relative_to(Path.cwd()))
    except ValueError:
        return str(beside)


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
        Gives messages (``live.ui.rerun``) that are all shown, from the beginning, of a finished test.
    """

    def __init__(
        self,
        setup: ViewSetup,
        *,
        port: int | None,
        rrd: Path | None,
        notify: Notify = lambda text, level: None,
        on_serving: Callable[[View], None] = lambda view: None,
        playback: MessageSource = lambda: (),
    ) -> None:
        self._setup, self._pending = setup, Pending()
        self._outbox = Outbox(setup, self._pending, playback)
        target = ViewTarget(port, None if rrd is None else str(rrd.absolute()), str(uuid.uuid4()))
        self._supervisor = Supervisor(self._outbox, target, notify, lambda: on_serving(self))
        self._picture_t = self._load_t = -math.inf
        self._supervisor.start()

    # -- what is shown ------------------------------------------------------------------------

    def picture(self, frame: Frame) -> None:
        """Offer a frame; ``picture_hz`` of them are taken per second of the test, at most."""
        if frame.t - self._picture_t >= 0.999 / self._setup.picture_hz:
            self._picture_t = frame.t
            self._pending.picture = frame

    def show(self, measurement: Measurement) -> None:
        """Offer a measurement: its means are shown, its field where no newer one comes first."""
        self._pending.row(Kind.MEANS, row_of(measurement))
        self._pending.field = measurement.t, measurement.field

    def point(self, axial: float, force: float) -> None:
        """Offer a point of the curve: strain along the load, and its final force (N); NaN is not drawn."""
        self._pending.row(Kind.POINTS, (axial, force))

    def load(self, t: float, force: float) -> None:
        """Offer a load sample (monotonic s, N); 50 a second are shown."""
        if t - self._load_t >= 0.999 * LOAD_STEP_S and math.isfinite(force):
            self._load_t = t
            self._pending.row(Kind.LOADS, (t, force))

    def event(self, event: Event) -> None:
        """Offer an event."""
        self._pending.event(event)

    def status(self, text_markdown: str) -> None:
        """Set the status card."""
        self._pending.status = text_markdown

    def figures(self, snapshot: Snapshot) -> None:
        """Set the large figures."""
        self._pending.figures = snapshot

    def close(self, seconds: float) -> None:
        """Draw what waits, finish the file and end; a process that takes longer is killed, and it is told."""
        self._supervisor.close(seconds)

    # -- what a person or a test asks ---------------------------------------------------------

    @property
    def port(self) -> int | None:
        """Where it is really served; None until it is."""
        return self._supervisor.served.port

    @property
    def rrd(self) -> Path | None:
        """The file that is written; None until it is."""
        rrd = self._supervisor.served.rrd
        return None if rrd is None else Path(rrd)

    @property
    def pid(self) -> int | None:
        """Of the process that draws, while there is one."""
        return self._supervisor.pid

    @property
    def failed(self) -> str:
        """Why the view has ended for good; empty while all is well."""
        return self._supervisor.failed

    @property
    def report(self) -> str:
        """What was sent and what was not, in a few words."""
        fields, pictures = (self._outbox.sent[kind] for kind in (Kind.FIELD, Kind.PICTURE))
        said = [f"{fields} maps and {pictures} pictures drawn"]
        if self._pending.dropped:
            said.append(f"{self._pending.dropped} rows or events dropped")
        if self._supervisor.starts > 1:
            said.append(f"its process was started {self._supervisor.starts} times")
        return ", ".join(said)

    @property
    def instructions(self) -> str:
        """How to look, now and later: one line for each way."""
        lines = []
        if self.port is not None:
            lines.append(f"watch: {rerun_command()} --connect {url(self.port)}")
            if not has_display():
                lines.append(f"watch from a machine with a display: {remote_access(self.port)}")
        if self.rrd is not None:
            lines.append(f"later: {rerun_command()} {self.rrd}")
        return "\n".join(lines)
