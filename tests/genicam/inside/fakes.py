"""Fake cameras as processes: started, stopped for a while, killed and started again."""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path
from types import TracebackType
from typing import Self

ROOT = Path(__file__).parents[3]


class FakeCameraProcess:
    """A fake camera on the loop-back; see ``tests.genicam.fake_camera`` for its options."""

    def __init__(self, *options: str) -> None:
        self._options, self._process = options, None
        self.plug()

    def plug(self, *others: str) -> None:
        """Start it, perhaps with other options, and wait until it answers."""
        words = [sys.executable, "-m", "tests.genicam.fake_camera", *(others or self._options)]
        self._process = subprocess.Popen(words, stdout=subprocess.PIPE, text=True, cwd=ROOT)
        assert self._process.stdout is not None
        assert self._process.stdout.readline() == "ready\n"

    def unplug(self) -> None:
        """Kill it: it answers nothing any more."""
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            assert self._process.stdout is not None
            self._process.stdout.close()
            self._process = None

    def pause(self) -> None:
        """It stands still, and answers nothing."""
        assert self._process is not None
        self._process.send_signal(signal.SIGSTOP)

    def go_on(self) -> None:
        """It continues where it stood."""
        assert self._process is not None
        self._process.send_signal(signal.SIGCONT)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.unplug()
