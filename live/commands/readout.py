"""``phasedic readout``: measure the readout time of a rolling shutter."""

from __future__ import annotations

import argparse
from pathlib import Path

from acquire.camera import with_scheme
from acquire.errors import ConfigError
from acquire.text import Message
from analysis.optics import Readout
from live.commands.options import add_config_file, add_options, add_verbose, overrides
from live.config.rig_file import write_rig
from live.setup.readout import LAMPS_HZ, from_lamp, from_motion, rounded_ms
from live.ui.terminal.screen import TerminalScreen


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``phasedic readout``."""
    words = (
        "camera, pictures or session: something still under the lamp, or a rigid specimen moved to and fro"
    )
    parser.add_argument("source", help=words)
    words = "the light flickers at this frequency, twice the mains; without it the specimen is moved"
    parser.add_argument("--lamp", type=float, choices=LAMPS_HZ, metavar="100|120", help=words)
    words = "rig file to which the time is written (default: print only)"
    add_config_file(parser, words)
    add_options(parser, "with a moved specimen", "roi", "mask", "zoi", "step")
    add_verbose(parser)


def command(arguments: argparse.Namespace) -> int:
    """``phasedic readout``."""
    screen = TerminalScreen()
    found = _of_motion(arguments, screen) if arguments.lamp is None else _of_lamp(arguments)
    changes = rounded_ms(found)
    screen.print(
        Message(
            "readout: {ms:.4g} ± {sigma:.2g} ms from the first line to the last",
            *(found.seconds * 1e3, found.sigma * 1e3),
        )
    )
    if arguments.config:
        write_rig(Path(arguments.config), changes)
        screen.print(Message("written to {path}; the former file is {path}.bak", arguments.config))
    return 0


def _of_lamp(arguments: argparse.Namespace) -> Readout:
    from live.setup.pictures import camera_of, whole_frames

    with camera_of(with_scheme(arguments.source)) as camera:
        return from_lamp(whole_frames(camera), arguments.lamp)


def _of_motion(arguments: argparse.Namespace, screen: TerminalScreen) -> Readout:
    from live.replay.opening import fields_of, open_source
    from live.replay.source import ReplayRequest

    single = {"measure.burst": 1, "measure.strain": "small", "measure.renew_at": 1.0}
    none = {"lens": {}, "plate": {}, "gauges": {}, "alarm": [], "camera.readout_ms": 0.0}
    file = Path(arguments.config) if arguments.config and Path(arguments.config).exists() else None
    request = ReplayRequest(arguments.source, file, {**overrides(arguments), **single, **none})
    with open_source(request) as (source, config):
        if source.camera.clock == "nominal" and not source.camera.fps:
            raise ConfigError("{source}: the pictures have no times; record a session", arguments.source)
        found = list(fields_of(source, config, arguments.source, screen))
    return from_motion([t for t, _ in found], [field for _, field in found], source.camera.height)
