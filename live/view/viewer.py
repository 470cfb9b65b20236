"""The viewer as a program of its own: found, started where there is a display, never waited for."""

from __future__ import annotations

import importlib.util
import logging
import os
import subprocess
import sys
from pathlib import Path

_log = logging.getLogger(__name__)

HOST = "127.0.0.1"


def url(port: int) -> str:
    """The address a viewer connects to."""
    return f"rerun+http://{HOST}:{port}/proxy"


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


def spawn_viewer(port: int, memory_limit: str = "2GB") -> subprocess.Popen[bytes] | None:
    """Open a viewer window on the view at ``port``.

    Parameters
    ----------
    port : int
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
    try:
        # A session of its own: Ctrl-C in our terminal is not meant for the viewer.
        return subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
    except OSError as error:
        _log.warning("the viewer %s did not start: %s", binary, error)
        return None


def rerun_command() -> str:
    """How a person calls the viewer from a terminal."""
    beside = Path(sys.executable).with_name("rerun")
    if not beside.is_file():
        return "rerun"
    try:
        return str(beside.relative_to(Path.cwd()))
    except ValueError:
        return str(beside)
