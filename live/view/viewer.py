"""The viewer as a program of its own: found, started where there is a display, never waited for.

It loads the libraries of the display when it starts, and ends at once where one is missing: a thread sees that.
"""

from __future__ import annotations

import importlib.util
import logging
import os
import re
import socket
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable
from pathlib import Path
from typing import IO

_log = logging.getLogger(__name__)

HOST = "127.0.0.1"
NEEDS = "apt install libx11-xcb1 libxcursor1 libxi6 libxkbcommon-x11-0 mesa-vulkan-drivers"
"""What brings the libraries of a window and of drawing in it to a Debian without desktop."""

_OPENING_S = 10.0
_ESCAPES, _PLACES = re.compile(r"\x1b\[[0-9;]*m"), re.compile(r"os error at \S+ ")


def url(port: int) -> str:
    """The address a viewer connects to."""
    return f"rerun+http://{HOST}:{port}/proxy"


def from_elsewhere(port: int) -> str:
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
    port: int, tell: Callable[[str], None] = lambda text: None, memory_limit: str = "2GB"
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
    threading.Thread(target=_see_open, args=(process, words, tell), name="viewer", daemon=True).start()
    return process


def _see_open(process: subprocess.Popen[bytes], words: IO[bytes], tell: Callable[[str], None]) -> None:
    """Tell where the viewer ends with an error instead of opening."""
    with words:
        try:
            failed = process.wait(_OPENING_S) > 0  # a signal is somebody's wish
        except subprocess.TimeoutExpired:
            return
        if failed:
            words.seek(0)
            tell(no_window(words.read().decode(errors="replace")))


def no_window(words: str) -> str:
    """The sentence for a viewer that ended as it started, from what it wrote."""
    lines = [line.strip() for line in _ESCAPES.sub("", words).splitlines()]
    why = next(
        (line.removeprefix("Error: ") for line in lines if line.startswith("Error: ")), "no reason given"
    )
    return f"the viewer did not open ({_PLACES.sub('', why)}); on a Debian without desktop it needs: {NEEDS}"


def rerun_command() -> str:
    """How a person calls the viewer from a terminal."""
    beside = Path(sys.executable).with_name("rerun")
    if not beside.is_file():
        return "rerun"
    try:
        return str(beside.relative_to(Path.cwd()))
    except ValueError:
        return str(beside)
