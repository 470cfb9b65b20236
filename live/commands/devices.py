"""``phasedic devices``: cameras with their formats, serial ports, and the number of measuring threads."""

from __future__ import annotations

import argparse

from live.ui.terminal.screen import print_line


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """``phasedic devices`` has no arguments."""


def command(arguments: argparse.Namespace) -> int:
    """``phasedic devices``."""
    from acquire.camera import list_cameras
    from acquire.serial_line.ports import list_serial_ports
    from acquire.text.printable import printable
    from analysis import threads

    cameras, ports = list_cameras(), list_serial_ports()
    print_line(
        "cameras:"
        if cameras
        else "cameras: none found (V4L2: /dev/video*; GigE and USB3 Vision: docs/machine-vision.md)"
    )
    for camera in cameras:
        for line in camera.text().splitlines():
            print_line(printable(line))
    print_line("serial ports:" if ports else "serial ports: none found")
    for port in ports:
        print_line(port.text())
    print_line(f"threads that measure: {threads()}")
    return 0
