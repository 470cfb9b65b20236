"""``phasedic devices`` and ``phasedic average``: what is plugged in, and dark or flat frames."""

from __future__ import annotations

import argparse
from pathlib import Path

from live.tell import Screen


def average(arguments: argparse.Namespace) -> int:
    """``phasedic average``: a dark frame (lens covered) or a flat frame (evenly lit)."""
    from acquire.burst import average_bursts, save_mean
    from acquire.errors import DataError
    from live.setup import open_rig

    screen = Screen()
    crop = tuple(arguments.crop) if arguments.crop else None
    rig = open_rig(arguments.camera, "none:", lambda event: screen.say(event.text), crop=crop)
    try:
        with rig.camera:
            burst = next(average_bursts(rig.camera, arguments.frames), None)
    finally:
        rig.close()
    if burst is None:
        raise DataError(f"{arguments.camera}: gave fewer than {arguments.frames} frames without a gap")
    save_mean(burst.mean, Path(arguments.out))
    noise = f", noise of one {burst.noise:.2f} GL" if burst.n > 1 else ""
    screen.say(f"{arguments.out}: {burst.n} frames, mean {burst.mean.mean():.1f} GL{noise}")
    return 0


def devices(arguments: argparse.Namespace) -> int:
    """``phasedic devices``."""
    from acquire.serial_line import list_serial_ports
    from acquire.v4l2 import list_cameras

    cameras, ports = list_cameras(), list_serial_ports()
    print("cameras:" if cameras else "cameras: none found (V4L2 devices are /dev/video*)")
    for camera in cameras:
        print(camera.text())
    print("serial ports:" if ports else "serial ports: none found")
    for port in ports:
        print(port.text())
    return 0
