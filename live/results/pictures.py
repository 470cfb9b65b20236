"""The picture of a measured instant: from the recording, or from the images that were measured."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

from acquire.camera import Camera, CroppedCamera, open_camera
from acquire.errors import PhasedicError
from acquire.frame import CameraInfo
from acquire.record_mode import Crop
from acquire.session import Session
from live.results.reader import Strain

Image = NDArray[Any]


@dataclass(frozen=True, slots=True, eq=False)
class Pictures:
    """Pictures by row of the results.

    Attributes
    ----------
    info : CameraInfo
        Size and bits.
    each : callable
        Takes rows in ascending order, gives the (H, W) image of each, in grey levels; None for one that is not
        readable, which may also raise DataError.
    """

    info: CameraInfo
    each: Callable[[Sequence[int]], Iterator[Image | None]]


def of_session(session: Session, strain: Strain) -> Pictures | None:
    """Pictures of a recording: the frame (or burst) nearest to the middle of each measured burst."""
    bursts = session.mode.kind == "bursts"
    n = session.burst_count if bursts else len(session)
    if not n:
        return None
    times = _BurstTimes(session) if bursts else [float(t) for t in session.times]

    def each(rows: Sequence[int]) -> Iterator[Image | None]:
        for row in rows:
            number = _nearest(times, n, float(strain.time_s[row]) + session.start_monotonic)
            yield session.burst(number).mean if bursts else session.frame(number).image

    return Pictures(session.camera, each)


def of_images(address: str, strain: Strain, crop: Crop | None = None) -> Pictures:
    """Pictures that a replay measured, cropped to ``crop`` (x, y, width, height).

    Raises as ``open_camera`` where they cannot be found any more.
    """
    with _opened(address, crop) as camera:
        info = camera.info

    def each(rows: Sequence[int]) -> Iterator[Image | None]:
        with _opened(address, crop) as again:
            yield from _numbered(again, [int(strain.values["frame"][row]) for row in rows])

    return Pictures(info, each)


def _opened(address: str, crop: Crop | None) -> Camera:
    camera = open_camera(address)
    if crop is None:
        return camera
    try:
        return CroppedCamera(camera, crop)
    except PhasedicError:
        camera.close()
        raise


def _numbered(camera: Camera, numbers: Sequence[int]) -> Iterator[Image]:
    wanted = iter(numbers)
    number = next(wanted, None)
    for frame in camera:
        while number is not None and frame.index >= number:
            yield frame.image
            number = next(wanted, None)
        if number is None:
            return


class _BurstTimes(Sequence[float]):
    """Times of recorded bursts, read on access."""

    def __init__(self, session: Session) -> None:
        self._session = session

    def __len__(self) -> int:
        return self._session.burst_count

    def __getitem__(self, number: Any) -> Any:
        return self._session.burst(number).t


def _nearest(times: Sequence[float], n: int, t: float) -> int:
    after = bisect_left(times, t, 0, n)
    if after == n:
        return n - 1
    return after - 1 if after and t - times[after - 1] < times[after] - t else after
