"""``phasedic average``: average frames to a dark frame (lens covered) or a flat frame (evenly lit)."""

from __future__ import annotations

import argparse
from pathlib import Path

from acquire.text import Message
from live.commands.options import add_options, whole
from live.ui.terminal.screen import TerminalScreen


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``phasedic average``."""
    parser.add_argument("--camera", required=True, metavar="ADDRESS", help="address of the camera")
    parser.add_argument(
        "--frames", type=whole(1, 10000), default=64, metavar="N", help="frames to average (default 64)"
    )
    add_options(parser, "picture", "crop")
    parser.add_argument("--out", required=True, metavar="FILE", help="new TIFF file")


def command(arguments: argparse.Namespace) -> int:
    """``phasedic average``: average frames to a dark frame (lens covered) or a flat frame (evenly lit)."""
    from acquire.burst import average_bursts, compile_loops, save_mean
    from acquire.errors import DataError
    from live.setup.dry_run import picture_kinds
    from live.setup.pictures import camera_of, frames_of

    screen = TerminalScreen()
    given = getattr(arguments, "camera.crop")
    crop = tuple(given) if given else None
    with camera_of(arguments.camera, lambda event: screen.print(event.text), crop=crop) as camera:
        compile_loops(picture_kinds(camera.info)[:1])
        burst = next(average_bursts(frames_of(camera), arguments.frames), None)
    if burst is None:
        raise DataError(
            "{camera}: gave fewer than {n} frames without a gap", arguments.camera, arguments.frames
        )
    save_mean(burst.mean, Path(arguments.out))
    noise = Message(", noise of one frame {noise:.2f} GL", burst.noise) if burst.n > 1 else ""
    mean = float(burst.mean.mean())
    screen.print(
        Message("{path}: {n} frames, mean {mean:.1f} GL{noise}", arguments.out, burst.n, mean, noise)
    )
    return 0
