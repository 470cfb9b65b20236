"""The view of a test, and the viewer program that shows it.

Drawing in the measuring process would take the interpreter lock and a processor core from the measurement. So
each method of ``View`` only appends; a thread (``supervisor``) collects twenty times a second what has come,
makes messages of it (``outbox``) and sends them to ``python -m live.ui.rerun.drawing``. The view measures
nothing; recording and results contain everything that the view leaves out.

The viewer is a program of the rerun SDK. It loads the libraries of the display when it starts and ends at once
where one is missing; a thread reports that.
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
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import IO, TYPE_CHECKING

from acquire.text import Message, joined
from live.ui.rerun.messages import ViewSetup, ViewTarget, row_of
from live.ui.rerun.outbox import MessageSource, Outbox, Pending
from live.ui.rerun.supervisor import Notify, Supervisor
from live.ui.rerun.wire import Kind
from live.words.language import told

if TYPE_CHECKING:
    from acquire.events import Event
    from acquire.frame import Frame
    from live.pipeline.measurement import Measurement
    from live.pipeline.snapshot import Snapshot
    from live.pipeline.timed.course import Floats

_log = logging.getLogger(__name__)

HOST = "127.0.0.1"
VIEWER_PACKAGES = "apt install libx11-xcb1 libxcursor1 libxi6 libxkbcommon-x11-0 mesa-vulkan-drivers"
"""Installs the libraries that a window needs on a Debian without desktop."""

LOAD_STEP_S = 0.02
"""Of load samples that come faster, one in this time is shown."""

_OPENING_S, _OFF = 10.0, ("off", "0", "false", "no")
_ANSI_CODES, _OS_ERROR = re.compile(r"\x1b\[[0-9;]*m"), re.compile(r"os error at \S+ ")


class View:
    """Shows a test. Only ``close`` waits; no method raises.

    Parameters
    ----------
    setup : ViewSetup
    port : int or None
        Where viewers connect, on 127.0.0.1, or the next free one. None: no server.
    rrd : Path or None
        File to look at later, never overwritten; a restarted process writes view-2.rrd ...
    notify : callable
        Called by the thread of the view with a message for a person and its level.
    on_serving : callable
        Called by the thread of the view with this view once viewers can connect, and again after a restart of
        the process.
    playback : callable
        Gives all messages of a finished test, from the beginning.
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
        if os.environ.get("RERUN", "").lower() in _OFF:
            notify(
                Message("RERUN=off is set: the view stays empty, and view.rrd too; unset the variable"),
                "warning",
            )
        else:
            self._supervisor.start()

    # -- what is shown ------------------------------------------------------------------------

    def picture(self, frame: Frame) -> None:
        """Offer a frame; at most ``picture_hz`` of them per second of the test are shown."""
        if frame.t - self._picture_t >= 0.999 / self._setup.picture_hz:
            self._picture_t = frame.t
            self._pending.picture = frame

    def show(self, measurement: Measurement) -> None:
        """Offer a measurement: its means are shown, its field unless a newer one replaces it."""
        self._pending.row(Kind.MEANS, row_of(measurement))
        self._pending.field = measurement.t, measurement.field

    def point(self, axial: float, force: float) -> None:
        """Offer a point of the curve: axial strain, final force (N); NaN is not drawn."""
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

    def whole(self, maps: Mapping[str, Floats]) -> None:
        """Set the maps of the whole test so far; none are left as they are."""
        self._pending.whole = maps or self._pending.whole

    def close(self, seconds: float) -> None:
        """Draw what waits and close the file; a process that takes longer than ``seconds`` is killed with a warning."""
        self._supervisor.close(seconds)

    # -- state --------------------------------------------------------------------------------

    @property
    def port(self) -> int | None:
        """The port that is served; None until then."""
        return self._supervisor.served.port

    @property
    def rrd(self) -> Path | None:
        """The file that is written; None until then."""
        rrd = self._supervisor.served.rrd
        return None if rrd is None else Path(rrd)

    @property
    def pid(self) -> int | None:
        """Process id of the drawing process; None where there is none."""
        return self._supervisor.pid

    @property
    def failed(self) -> str:
        """Why the view has ended for good; empty while it runs."""
        return self._supervisor.failed

    @property
    def report(self) -> str:
        """Counts of what was drawn and dropped."""
        fields, pictures = (self._outbox.sent[kind] for kind in (Kind.FIELD, Kind.PICTURE))
        parts = [Message("{fields} maps and {pictures} pictures drawn", fields, pictures)]
        if self._pending.dropped:
            parts.append(Message("{n} rows or events dropped", self._pending.dropped))
        if self._supervisor.starts > 1:
            parts.append(Message("its process was started {n} times", self._supervisor.starts))
        return joined(", ", parts)

    @property
    def instructions(self) -> str:
        """How to watch now and later: one line for each way."""
        lines = []
        if self.port is not None:
            watch = f"{rerun_command()} --connect {url(self.port)}"
            lines.append(told(Message("watch: {command}", watch)))
            if not has_display():
                lines.append(
                    told(Message("watch from a machine with a display: {how}", remote_access(self.port)))
                )
        if self.rrd is not None:
            lines.append(told(Message("later: {command}", f"{rerun_command()} {self.rrd}")))
        return "\n".join(lines)


def url(port: int) -> str:
    """The address a viewer connects to."""
    return f"rerun+http://{HOST}:{port}/proxy"


def remote_access(port: int) -> str:
    """How to watch from another machine: a tunnel, since the view accepts connections of this machine alone."""
    tunnel = f"ssh -N -L {port}:{HOST}:{port} {socket.gethostname()}"
    return Message("{tunnel}, and there: rerun --connect {url}", tunnel, url(port))


def viewer_binary() -> Path | None:
    """The viewer of the installed SDK; PATH is not searched, a venv is often not in it."""
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
    notify : callable
        Called by a thread with one sentence where the viewer ends with an error as it starts.
    memory_limit : str
        Of the viewer, which drops the oldest data beyond it. Its own default is 75 % of all memory.

    Returns
    -------
    Popen or None
        None without a display or without the viewer's program, or when it cannot start.
    """
    binary = viewer_binary()
    if binary is None or not has_display():
        return None
    command = [str(binary), "--connect", url(port), "--memory-limit", memory_limit, "--hide-welcome-screen"]
    # A file and no pipe: the viewer may outlive this process, and must not block on a full pipe.
    words = tempfile.TemporaryFile()  # noqa: SIM115 - closed by the thread
    try:
        # A separate session: Ctrl-C in this terminal must not end the viewer.
        process = subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=words, start_new_session=True
        )
    except OSError as error:
        words.close()
        _log.warning(Message("the viewer {path} did not start: {error}", binary, error))
        return None

    def watch() -> None:
        if why := _not_opened(process, words):
            notify(why)

    threading.Thread(target=watch, name="viewer", daemon=True).start()
    return process


def _not_opened(process: subprocess.Popen[bytes], words: IO[bytes]) -> str:
    """Why a viewer ended with an error instead of opening; empty where it opens."""
    with words:
        try:
            failed = process.wait(_OPENING_S) > 0  # below 0: ended by a signal, on purpose
        except subprocess.TimeoutExpired:
            return ""
        words.seek(0)
        return viewer_failure(words.read().decode(errors="replace")) if failed else ""


def viewer_failure(words: str) -> str:
    """The message for a viewer that ended as it started, from its output."""
    lines = [line.strip() for line in _ANSI_CODES.sub("", words).splitlines()]
    why = next(
        (line.removeprefix("Error: ") for line in lines if line.startswith("Error: ")), "no reason given"
    )
    reason = _OS_ERROR.sub("", why)
    return Message(
        "the viewer did not open ({reason}); on a Debian without desktop it needs: {packages}",
        reason,
        VIEWER_PACKAGES,
    )


def rerun_command() -> str:
    """The command that starts the viewer from a terminal."""
    beside = Path(sys.executable).with_name("rerun")
    if not beside.is_file():
        return "rerun"
    try:
        return str(beside.relative_to(Path.cwd()))
    except ValueError:
        return str(beside)
