"""``phasedic readout``: the readout time of a rolling shutter, from a flickering lamp or a specimen that is moved."""

from __future__ import annotations

import argparse
import itertools
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from acquire.camera import with_scheme
from acquire.errors import ConfigError, DataError
from acquire.frame import Frame
from acquire.text import Message
from analysis.field import StrainField
from analysis.optics import Readout, readout_of_bands, readout_of_motion
from live.commands.options import add_config_file, add_options, add_verbose, overrides
from live.config.rig_file import write_rig
from live.ui.terminal.screen import TerminalScreen

LAMPS_HZ = (100.0, 120.0)
BAND_PICTURES = 128
"""Pictures from which bands are measured, at most."""


def from_lamp(frames: Iterable[Frame], lamp_Hz: float) -> Readout:
    """From whole pictures of anything that stands still in the light of a lamp of ``lamp_Hz``.

    Raises
    ------
    DataError
        Too few pictures, or no bands that move through them.
    """
    taken = itertools.islice(frames, BAND_PICTURES)
    profiles = [frame.image.mean(axis=1, dtype=np.float64) for frame in taken]
    try:
        return readout_of_bands(np.array(profiles).reshape(len(profiles), -1), lamp_Hz)
    except ValueError as error:
        raise DataError(
            "{why}: a global shutter has none; take an exposure below 5 ms, a lamp that flickers, and a frame rate"
            " that does not divide its frequency",
            error,
        ) from None


def from_motion(t: Sequence[float], fields: Sequence[StrainField], height: int) -> Readout:
    """From the fields of a rigid specimen that is moved to and fro; times in s, of single pictures.

    Raises
    ------
    DataError
        Too few pictures, or too little motion.
    """
    u, v, du_dy, dv_dy = ([field.mean(name)[0] for field in fields] for name in ("u", "v", "du_dy", "dv_dy"))
    try:
        return readout_of_motion(t, (u, v), (du_dy, dv_dy), height)
    except ValueError as error:
        raise DataError("the readout time is not measured: {why}", error) from None


def rounded_ms(found: Readout) -> dict[str, float]:
    """The changes of a rig file; raises ConfigError where the time cannot be one of a shutter."""
    if not 0 < found.seconds < 10:
        raise ConfigError(
            "{ms:.3g} ms is no readout time; is the picture turned, or does the camera read upwards?",
            found.seconds * 1e3,
        )
    return {
        "camera.readout_ms": float(f"{found.seconds * 1e3:.5g}"),
        "camera.sigma_readout_ms": float(f"{found.sigma * 1e3:.2g}"),
    }


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
