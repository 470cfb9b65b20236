"""A live camera that is watched while something is done to it."""

from __future__ import annotations

import time
from collections.abc import Callable
from itertools import pairwise

from acquire.camera.contract import open_camera
from acquire.events import Event
from acquire.frame import Frame


class FrameWatch:
    """A camera, the frames that came, the events, and what to do at a frame or an event."""

    patience_s = 60.0

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
        """Take frames until ``until()``, and do ``at[k]()`` after the k-th; 500 frames at most, for a while."""
        begun = time.monotonic()
        with self.camera:
            for frame in self.camera:
                self.frames.append(frame)
                (at or {}).get(len(self.frames), lambda: None)()
                if until():
                    return
                assert len(self.frames) < 500 and time.monotonic() - begun < self.patience_s, self.texts()

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
        for earlier, later in pairwise(self.frames):
            assert later.index > earlier.index
            assert later.t >= earlier.t
            assert later.lost_before == later.index - earlier.index - 1
