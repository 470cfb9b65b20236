"""A part of a camera's picture as a camera of its own: what is cut away is neither measured nor stored.

All coordinates downstream (ROI, mask, results) count from the corner of that part.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from types import TracebackType
from typing import Self

from acquire.camera.contract import Camera
from acquire.frame import CameraInfo, Frame, frozen
from acquire.record_mode import Crop, RecordMode


class CroppedCamera:
    """See ``acquire.camera.Camera``.

    Parameters
    ----------
    camera : Camera
    crop : (x, y, width, height), px

    Raises
    ------
    ConfigError
        The part leaves the picture.
    """

    def __init__(self, camera: Camera, crop: Crop) -> None:
        self._camera, self._cut = camera, RecordMode(crop=crop)
        self._cut.check(camera.info.width, camera.info.height)
        controls = {**camera.info.controls, "crop": list(crop)}
        self.info: CameraInfo = dataclasses.replace(
            camera.info, width=crop[2], height=crop[3], controls=controls
        )

    def __enter__(self) -> Self:
        self._camera.__enter__()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._camera.__exit__(kind, error, trace)

    def __iter__(self) -> Iterator[Frame]:
        for frame in self._camera:
            yield dataclasses.replace(frame, image=frozen(self._cut.cut(frame.image).copy()))

    def stop(self) -> None:
        """End the iteration; from any thread."""
        self._camera.stop()

    def close(self) -> None:
        """Release the device."""
        self._camera.close()
