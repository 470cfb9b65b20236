"""``phasedic average``: average frames to a dark frame (lens covered) or a flat frame (evenly lit)."""

from __future__ import annotations

import argparse
from pathlib import Path

from live.commands.options import add_options
from live.ui.terminal.screen import TerminalScreen


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``phasedic average``."""
    parser.add_argument("--camera", required=True, metavar="ADDRESS", help="address of the camera")
    parser.add_argument("--frames", type=int, default=64, metavar="N", help="frames to average (default 64)")
    add_options(parser, "picture", "crop")
    parser.add_argument("--out", required=True, metavar="FILE", help="new TIFF file")


def command(arguments: argparse.Namespace) -> int:
    """``phasedic average``: average frames to a dark frame (lens covered) or a flat frame (evenly lit)."""
    from acquire.burst import average_bursts, compile_loops, save_mean
    from acquire.errors import DataError
    from live.setup.devices import at_rest, open_rig
    from live.setup.dry_run import picture_kinds

    screen = TerminalScreen()
    given = getattr(arguments, "camera.crop")
    crop = tuple(given) if given else None
    rig = open_rig(at_rest(arguments.camera), "none:", lambda event: screen.print(event.text), crop=crop)
    try:
        compile_loops(picture_kinds(rig.camera.info)[:1])
        with rig.camera:
            burst = next(average_bursts(rig.camera, arguments.frames), None)
    finally:
        rig.close()
    if burst is None:
        raise DataError(
            "{camera}: gave fewer than {n} frames without a gap", arguments.camera, arguments.frames
        )
    save_mean(burst.mean, Path(arguments.out))
    noise = f", noise of one frame {burst.noise:.2f} GL" if burst.n > 1 else ""
    screen.print(f"{arguments.out}: {burst.n} frames, mean {burst.mean.mean():.1f} GL{noise}")
    return 0
