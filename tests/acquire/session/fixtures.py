"""Small sessions for the tests."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from acquire.burst.accumulate import BurstAccumulator
from acquire.clock import ClockPair
from acquire.frame import Burst, CameraInfo, Frame, frozen
from acquire.load_sample import LoadCellInfo, LoadFlag, LoadSample
from acquire.session import SessionInfo, SessionWriter

START = ClockPair(1000.1, datetime(2026, 5, 9, 7, 35, 25, 123456, tzinfo=UTC))
CAMERA = CameraInfo(
    "sim:", "test camera", 16, 12, 12, True, "device", 60.0, 0.008, "Y12", {"gain": 3}, ("a warning",)
)
LOAD = LoadCellInfo("/dev/ttyUSB0", "ascii on /dev/ttyUSB0", "ascii", sign=-1, capacity_N=500.0)


def frame(number: int, camera: CameraInfo = CAMERA, **changes: Any) -> Frame:
    """A frame with a picture of its own."""
    rng = np.random.default_rng(number)
    dtype = np.uint8 if camera.bits <= 8 else np.uint16
    image = rng.integers(0, 2**camera.bits, (camera.height, camera.width)).astype(dtype)
    t = START.monotonic + number / 60 + 1 / 3
    plain = Frame(frozen(image), 5 + number, t, camera.clock, 0, camera.bits, t + 0.004)
    return dataclasses.replace(plain, **changes)


def sample(number: int) -> LoadSample:
    """A load sample; every seventh one is an overload."""
    t = START.monotonic + number / 80
    if number % 7 == 6:
        return LoadSample(
            t, float("nan"), "kgf", False, LoadFlag.OVERLOAD | LoadFlag.NET, b"OL,+9999999.9  g"
        )
    return LoadSample(t, number / 3, "N", None, LoadFlag.NONE, b"%d.5 N\x00" % number, number * 12.5)


def info(camera: CameraInfo = CAMERA, **changes: Any) -> SessionInfo:
    """What a session of the test camera says of itself."""
    about = SessionInfo(
        camera=camera,
        load=LOAD,
        start=START,
        config={"measure": {"zoi": 64}},
        metadata={"operator": "Zoé"},
        versions={"phasedic": "0.1.0"},
    )
    return dataclasses.replace(about, **changes)


def writer(
    path: Path, camera: CameraInfo = CAMERA, now: Callable[[], float] = time.monotonic, **changes: Any
) -> SessionWriter:
    """A new session of the test camera."""
    return SessionWriter(path, info(camera, **changes), now=now)


def recorded(
    path: Path, frames: int = 1, *, loads: bool = True, camera: CameraInfo = CAMERA, **changes: Any
) -> Path:
    """A closed session of so many frames, each with a load sample."""
    with writer(path, camera, **changes) as session:
        for k in range(frames):
            if loads:
                session.write_load(sample(k))
            session.write_frame(frame(k, camera))
    return path


def bursts_of(n: int, count: int, camera: CameraInfo = CAMERA) -> list[Burst]:
    """Bursts of the test camera."""
    accumulator = BurstAccumulator(n)
    found = [accumulator.add(frame(k, camera)) for k in range(n * count)]
    return [burst for burst in found if burst is not None]
