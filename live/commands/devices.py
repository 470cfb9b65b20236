"""``phasedic devices``: cameras with their formats, serial ports, and the number of measuring threads."""

from __future__ import annotations

import argparse
from pathlib import Path

from acquire.text import Message
from live.ui.terminal.screen import print_line


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``phasedic devices``."""
    words = "watch each device and write what it does, to be sent: no pictures, no names (default FILE: %(const)s)"
    parser.add_argument("--report", nargs="?", const="phasedic-devices.txt", metavar="FILE", help=words)
    words = "the settings that an address of each kind of camera takes"
    parser.add_argument("--settings", action="store_true", help=words)
    words = "with --report: only this camera; may be repeated"
    parser.add_argument("--camera", action="append", default=[], metavar="ADDRESS", help=words)
    words = "with --report: only this load cell; may be repeated"
    parser.add_argument("--load", action="append", default=[], metavar="ADDRESS", help=words)
    words = "with --report: how long each is watched (default 5)"
    parser.add_argument("--seconds", type=float, default=5.0, metavar="S", help=words)


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
    from live.setup.devices import camera_settings

    for scheme, kind in camera_settings().items():
        print_line(f"{scheme}:" if scheme else "/dev/...:")
        for one in settings_of(kind):
            more = "; ".join(filter(None, (one.allowed, one.unit, one.stands)))
            print_line(f"  {one.key or '...'}: {one.words}" + f" ({more})" * bool(more))
    return 0


def _report(arguments: argparse.Namespace) -> int:
    """Show the lines as they come, and keep them in a new file."""
    from live.commands.device_report import report_lines, without_names
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
