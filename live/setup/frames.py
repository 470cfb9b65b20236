"""The frames of one source outside of a test: a camera or recorded pictures, without a load cell."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from acquire.camera import Camera
from acquire.errors import DeviceError
from acquire.events import Event, EventSink, ignore_event
from acquire.frame import Frame
from acquire.record_mode import Crop
from live.setup.devices import at_rest, open_rig

SILENCE_S = 20.0
"""Wait for the next whole picture; a run waits for ever, since a test may be under way."""


@contextmanager
def camera_of(
    address: str, on_event: EventSink = ignore_event, *, crop: Crop | None = None, resting: bool = True
) -> Iterator[Camera]:
    """The camera of an address, opened, to be started by ``with``; closed at the end. Raises as ``open_rig``.

    ``resting``: a simulated specimen is not pulled, and its pictures go on.
    """
    rig = open_rig(at_rest(address) if resting else address, "none:", on_event, crop=crop)
    try:
        yield rig.camera
    finally:
        rig.close()


def frames_of(camera: Camera) -> Iterator[Frame]:
    """Start a camera, and give its frames, damaged ones too.

    Raises
    ------
    DeviceError
        No whole one comes for ``SILENCE_S``.
    """
    silent = False

    def stop() -> None:
        nonlocal silent
        silent = True
        camera.stop()

    def watch() -> threading.Timer:
        timer = threading.Timer(SILENCE_S, stop)
        timer.start()
        return timer

    with camera:
        watched = watch()
        try:
            for frame in camera:
                if not frame.damaged:
                    watched.cancel()
                yield frame
                if not frame.damaged:
                    watched = watch()
        finally:
            watched.cancel()
    if silent:
        raise DeviceError(
            "{name}: no whole picture came in {SILENCE_S:g} s; look at its cable, its trigger and the light, and "
            "call again",
            camera.info.name,
            SILENCE_S,
        )


def whole_frames(camera: Camera) -> Iterator[Frame]:
    """The same without the damaged ones."""
    return (frame for frame in frames_of(camera) if not frame.damaged)


def report_warnings(print_line: Callable[[str], None]) -> EventSink:
    """An event sink that passes the warnings and errors of a device to ``print_line``."""

    def report(event: Event) -> None:
        if event.level != "info":
            print_line(event.text)

    return report
