"""Fake cameras as processes: started, stopped for a while, killed and started again."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Self

from acquire.camera.contract import open_camera
from acquire.events import Event
from acquire.frame import Frame

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


class FrameWatch:
    """A camera, the frames that came, the events, and what to do at a frame or an event."""

    def __init__(self, address: str) -> None:
        self.events: list[Event] = []
        self.frames: list[Frame] = []
        self.on_text: dict[str, Callable[[], None]] = {}
        self.camera = open_camera(address, self._on_event)

    def _on_event(self, event: Event) -> None:
        self.events.append(event)
        for words, action in list(self.on_text.items()):
            if words in event.text:
                del self.on_text[words]
                action()

    def take(self, until: Callable[[], bool], at: dict[int, Callable[[], None]] | None = None) -> None:
        """Take frames until ``until()``, and do ``at[k]()`` after the k-th; 500 frames or 60 s at most."""
        begun = time.monotonic()
        with self.camera:
            for frame in self.camera:
                self.frames.append(frame)
                (at or {}).get(len(self.frames), lambda: None)()
                if until():
                    return
                assert len(self.frames) < 500 and time.monotonic() - begun < 60, self.texts()

    def first(self, count: int) -> list[Frame]:
        """The first frames."""
        self.take(lambda: len(self.frames) >= count)
        return self.frames

    def after(self, words: str, more: int = 4) -> Callable[[], bool]:
        """True once so many frames have come after an event with these words."""
        seen: list[int] = []

        def met() -> bool:
            if not seen and words in self.texts():
                seen.append(len(self.frames))
            return bool(seen) and len(self.frames) >= seen[0] + more

        return met

    def texts(self) -> str:
        return "\n".join(event.text for event in self.events)

    def check_numbers(self) -> None:
        """Numbers increase, times do not run back, gaps agree."""
        for earlier, later in zip(self.frames, self.frames[1:], strict=False):
            assert later.index > earlier.index
            assert later.t >= earlier.t
            assert later.lost_before == later.index - earlier.index - 1
