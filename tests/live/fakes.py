"""Devices that exist only as lists: for tests of the threads and the pipeline."""

from __future__ import annotations

import threading
from collections.abc import Iterable, Iterator
from types import TracebackType
from typing import Self

import numpy as np

from acquire.frame import CameraInfo, Frame, frozen


def frame(
    index: int, *, value: int = 100, lost: int = 0, damaged: bool = False, shape: tuple[int, int] = (4, 6)
) -> Frame:
    image = frozen(np.full(shape, value, np.uint8))
    return Frame(image, index, index / 10, "nominal", lost, 8, index / 10, damaged)


class ListCamera:
    """Gives the frames of a list, then the error it was made with."""

    def __init__(
        self, frames: Iterable[Frame], *, live: bool = False, error: Exception | None = None
    ) -> None:
        self._frames, self._error = list(frames), error
        height, width = self._frames[0].image.shape if self._frames else (4, 6)
        self.info = CameraInfo("list:", "a list of frames", width, height, 8, live, "nominal")
        self.stopped = threading.Event()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def __iter__(self) -> Iterator[Frame]:
        for item in self._frames:
            if self.stopped.is_set():
                return
            yield item
        if self._error is not None:
            raise self._error

    def stop(self) -> None:
        self.stopped.set()

    def close(self) -> None:
        self.stopped.set()
