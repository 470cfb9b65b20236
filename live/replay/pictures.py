"""Pictures as the material of a replay: a folder, a video, anything that a camera address names."""

from __future__ import annotations

import datetime
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from acquire.burst import average_bursts, burst_of
from acquire.camera import Camera
from acquire.clock import ClockPair
from acquire.errors import DataError
from acquire.frame import Burst, CameraInfo, Frame, frozen
from acquire.load_cell import LoadLog
from live.replay.material import Material, ReplayRequest, window_of, within
from live.setup import Config


def picture_material(camera: Camera, request: ReplayRequest, config: Config) -> Material:
    frames = iter(camera)
    if request.reference is not None:
        reference = burst_of([_reference_frame(Path(request.reference), camera.info)])
    else:
        reference = _leading_burst(frames, config.measure.reference_burst or 1, request.source)
    loads = LoadLog(config.load.max_gap_s)
    loads.close()
    bursts = within(average_bursts(frames, config.measure.burst or 1), window_of(request, 0.0))
    return Material(
        camera.info, reference, bursts, loads, ClockPair(0.0, datetime.datetime.now(datetime.UTC))
    )


def _leading_burst(frames: Iterator[Frame], n: int, source: str) -> Burst:
    for burst in average_bursts(frames, n):
        return burst
    raise DataError(f"{source}: fewer than {n} pictures for the reference; give a smaller --reference-burst")


def _reference_frame(path: Path, camera: CameraInfo) -> Frame:
    from acquire.opencv import read_image

    image = read_image(path)
    if image.shape != (camera.height, camera.width):
        raise DataError(
            f"{path}: the reference has {image.shape[1]} x {image.shape[0]} px,"
            f" the pictures {camera.width} x {camera.height}; they must be the same"
        )
    return Frame(image, 0, 0.0, "nominal", 0, camera.bits, 0.0)


def picture_of(burst: Burst) -> Frame:
    """What the view shows of a burst: its mean, rounded."""
    kind = np.uint8 if burst.bits <= 8 else np.uint16
    image = burst.mean if burst.mean.dtype == kind else np.rint(burst.mean).astype(kind)
    return Frame(frozen(image), burst.first_index, burst.t, burst.clock, 0, burst.bits, burst.t)
