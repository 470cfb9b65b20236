"""``phasedic devices``: cameras with their formats, serial ports, and the number of measuring threads.

With ``--report`` it writes what devices of a stranger do, measured, without pictures and names: cameras are opened and
watched for some seconds; serial ports are listened to, and nothing is sent.
"""

from __future__ import annotations

import argparse
import getpass
import os
import platform
import re
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from acquire.addresses import with_setting
from acquire.camera import list_cameras
from acquire.errors import PhasedicError
from acquire.events import Event
from acquire.frame import CameraInfo, Frame
from acquire.load_cell import check
from acquire.serial_line import identify
from acquire.serial_line.ports import list_serial_ports
from acquire.text.message import Message, brief, printable, word
from live import VERSION
from live.commands.options import number
from live.setup.devices import open_load
from live.setup.pictures import camera_of
from live.ui.terminal.screen import print_line

CROP, MAX_CROPS = 256, 64  # px of the middle of the picture, and how many, that noise is taken from
MAX_EVENTS = 20
_SERIAL = re.compile(r"(?<![\w.])(?=(?:[A-Fa-f]*\d){5})[0-9A-Fa-f]{7,}(?![\w.])")


def report_lines(cameras: Sequence[str], loads: Sequence[str], seconds: float) -> Iterator[str]:
    """The lines of the report, one after the other as they are known.

    Parameters
    ----------
    cameras, loads : sequence of str
        Addresses; where there are none, all that are found.
    seconds : float, s
        How long each is watched.
    """
    yield f"phasedic {VERSION}, {platform.platform()}, Python {platform.python_version()}, {os.cpu_count()} processors"
    everything = not (cameras or loads)
    listed = list_cameras() if everything else []
    for camera in listed:
        yield from without_serials(camera.text().replace(camera.stable_address or "\0", "...")).splitlines()
    for address in [*cameras, *(camera.address for camera in listed if not camera.trouble)]:
        yield from _guarded(f"camera {address}", _camera_lines(address, seconds))
    ports = [port.device for port in list_serial_ports() if port.accessible] if everything else []
    for port in ports:
        yield from _guarded(f"port {port}", _port_lines(port, seconds))
    for address in loads:
        yield from _guarded(f"load cell {address}", _load_lines(address, seconds))
    for what, found, option in ("camera", listed, "--camera"), ("serial port", ports, "--load"):
        if everything and not found:
            yield Message("no {what} was found; {option} ADDRESS gives one", word(what), option)


def without_names(line: str) -> str:
    """The line without host, user and home folder."""
    with suppress(KeyError, OSError):  # a user without a name
        line = line.replace(str(Path.home()), "~")
        for name in filter(None, (platform.node(), getpass.getuser())):
            line = re.sub(rf"\b{re.escape(name)}\b", "...", line)
    return printable(line)


def without_serials(text: str) -> str:
    """The name of a device without its serial number; lines that were heard keep their numbers."""
    return _SERIAL.sub("...", text)


def _guarded(title: str, lines: Iterator[str]) -> Iterator[str]:
    """A device that fails has its message, and the others go on."""
    yield f"{without_serials(title)}:"
    try:
        yield from (f"  {line}" for line in lines)
    except PhasedicError as error:
        yield f"  {brief(error)}"


def _camera_lines(address: str, seconds: float) -> Iterator[str]:
    events: list[Event] = []
    with camera_of(address, events.append) as camera, camera:
        info = camera.info
        yield f"{without_serials(info.name)}, {info.width}x{info.height}, {info.pixel_format} {info.bits} bits"
        yield f"clock {info.clock}, fps {info.fps}, exposure {info.exposure_s} s, controls {dict(info.controls)}"
        yield f"formats {' '.join(info.formats) or 'not listed'}, warnings {info.warnings}"
        end = threading.Timer(seconds, camera.stop)
        end.start()
        seen = [(time.monotonic(), replace(frame, image=_middle(frame))) for frame in camera]
        end.cancel()
    yield from (f"{event.level}: {event.text}" for event in events[:MAX_EVENTS])
    yield from _measured(info, [frame for _, frame in seen], np.array([arrival for arrival, _ in seen]))


def _middle(frame: Frame) -> np.ndarray:
    top, left = (max(side - CROP, 0) // 2 for side in frame.image.shape)
    return frame.image[top : top + CROP, left : left + CROP].copy()


def _measured(info: CameraInfo, frames: Sequence[Frame], arrivals: np.ndarray) -> Iterator[str]:
    if len(frames) < 3:
        yield f"{len(frames)} frames came: too few; check trigger, cable and format"
        return
    stamps = np.array([frame.t for frame in frames])
    lost, damaged = sum(frame.lost_before for frame in frames), sum(frame.damaged for frame in frames)
    yield f"{len(frames)} frames, lost {lost}, damaged {damaged}, rate {1 / np.diff(stamps).mean():.3f} 1/s"
    for what, times in (
        ("from stamp to stamp", np.diff(stamps)),
        ("fetched after mid-exposure", arrivals - stamps),
    ):
        low, middle, high = 1e3 * np.percentile(times, [0, 50, 100])
        yield f"{what}: {middle:.2f} ms ({low:.2f} to {high:.2f})"
    crops = np.array([frame.image for frame in frames[:MAX_CROPS]], np.float32)
    noise = np.median([np.std(later - first) for first, later in pairwise(crops)]) / np.sqrt(2)
    clipped = 100 * np.mean(crops >= info.saturation)
    yield f"middle: mean {crops.mean():.1f} GL, noise {noise:.2f} GL, saturated {clipped:.2f} %"


def _port_lines(device: str, seconds: float) -> Iterator[str]:
    for baud, received, finding in identify.listen(device):
        yield (
            f"{baud} baud: {len(received)} bytes, {received[-80:]!r}" if received else f"{baud} baud: silence"
        )
        if finding is not None:
            yield f"understood as {finding.address}; {finding.remark}"
            yield from _load_lines(with_setting(finding.address, "gain", 1.0), seconds)


def _load_lines(address: str, seconds: float) -> Iterator[str]:
    events: list[Event] = []
    with open_load(address, events.append) as cell:
        yield from check.report_lines(check.report(check.listen(cell, seconds), cell.info))
    yield from (f"{event.level}: {event.text}" for event in events[:MAX_EVENTS])


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``phasedic devices``."""
    words = "watch each device and write what it does, to be sent: no pictures, no names (default FILE: %(const)s)"
    parser.add_argument("--report", nargs="?", const="phasedic-devices.txt", metavar="FILE", help=words)
    words = "the settings that an address of each kind of camera and load cell takes"
    parser.add_argument("--settings", action="store_true", help=words)
    words = "with --report: only this camera; may be repeated"
    parser.add_argument("--camera", action="append", default=[], metavar="ADDRESS", help=words)
    words = "with --report: only this load cell; may be repeated"
    parser.add_argument("--load", action="append", default=[], metavar="ADDRESS", help=words)
    words = "with --report: how long each is watched (default 5)"
    parser.add_argument("--seconds", type=number(0.1, 3600), default=5.0, metavar="S", help=words)


def command(arguments: argparse.Namespace) -> int:
    """``phasedic devices [--report [FILE]]``."""
    if arguments.report is not None:
        return _report(arguments)
    if arguments.settings:
        return _settings()
    from acquire.camera import list_cameras
    from acquire.serial_line.ports import list_serial_ports
    from analysis import threads

    cameras, ports = list_cameras(), list_serial_ports()
    none = Message("cameras: none found (V4L2: /dev/video*; GigE and USB3 Vision: docs/machine-vision.md)")
    print_line(Message("cameras:") if cameras else none)
    for camera in cameras:
        print_line(camera.text())
    print_line(Message("serial ports:") if ports else Message("serial ports: none found"))
    for port in ports:
        print_line(port.text())
    print_line(Message("threads that measure: {threads}", threads()))
    return 0


def _settings() -> int:
    from acquire.settings import settings_of
    from live.setup.devices import camera_settings, load_settings

    for head, kinds in ((Message("cameras:"), camera_settings()), (Message("load cells:"), load_settings())):
        print_line(head)
        for scheme, kind in kinds.items():
            print_line(f"  {scheme}:" if scheme else "  /dev/...:")
            for one in settings_of(kind):
                more = "; ".join(filter(None, (one.allowed, one.unit, one.stands)))
                print_line(f"    {one.key or '...'}: {one.words}" + f" ({more})" * bool(more))
    return 0


def _report(arguments: argparse.Namespace) -> int:
    """Show the lines as they come, and keep them in a new file."""
    from live.commands.options import require_new

    path = Path(arguments.report)
    require_new(path)
    kept = []
    for line in report_lines(arguments.camera, arguments.load, arguments.seconds):
        kept.append(without_names(line))
        print_line(kept[-1])
    path.write_text("\n".join(kept) + "\n", encoding="utf-8")
    print_line(Message("written: {path}; read it, then send it with what you saw", path))
    return 0
