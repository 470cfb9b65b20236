"""``phasedic lens``: calibrate the lens from pictures of a board, or from shifted pictures of the specimen."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from acquire.camera import with_scheme
from acquire.errors import ConfigError
from acquire.text.message import Message, word
from live.commands.options import add_config_file, add_options, add_verbose, overrides, require_new
from live.commands.scale import add_board, board_of
from live.config.loading import load_config, settings_in
from live.config.rig_file import write_rig
from live.pipeline.consumer import Screen
from live.setup.lens import LensCalibration, from_boards, from_shifts, lens_words
from live.ui.terminal.screen import TerminalScreen

if TYPE_CHECKING:
    import numpy as np


MAX_SHIFTS = 60
"""Shifted pictures that are fitted; of more, as many evenly chosen ones."""
SHOWN_ZOI, SHOWN_STEP = 64, 16


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``phasedic lens``."""
    words = "'board/*.png', a video, or pictures or session of the specimen, still and shifted in its plane"
    parser.add_argument("source", help=words)
    add_board(parser.add_argument_group("pictures of a board; without one they are of the specimen"))
    parser.add_argument("--k3", action="store_true", help="with a board: also the term of r^6 (wide angles)")
    words = "without a board: the camera is square to the specimen, so that tangential terms can be found"
    parser.add_argument("--square-on", action="store_true", help=words)
    parser.add_argument("--out", metavar="FILE", help="new file for --lens (default: lens.toml)")
    add_config_file(parser)
    add_options(parser, "pictures of the specimen", "roi", "mask", "zoi")
    add_verbose(parser)


def command(arguments: argparse.Namespace) -> int:
    """``phasedic lens``."""
    screen, out = TerminalScreen(), Path(arguments.out or "lens.toml")
    require_new(out)
    board = board_of(arguments)
    if board is None:
        found = _of_specimen(arguments, screen)
    else:
        found = from_boards(_pictures(arguments), board, k3=arguments.k3)
    for line in _lines(found):
        screen.print(line)
    write_rig(out, found.changes)
    screen.print(
        Message(
            'written to {out}; use it with --lens {out}, or lens = "{out}" at the head of the rig file', out
        )
    )
    return 0


def _lines(found: LensCalibration) -> Iterator[str]:
    from analysis import Roi, ZoiGrid

    lens, (x, y, width, height) = found.fit.lens, found.box
    yield Message("lens: {method}, {rms:.3g} px rms", found.method, found.fit.rms_px)
    if found.fit.over_noise > 1.5:
        yield Message(
            "LOOK  the fit leaves {over:.1f} times the noise: is the specimen flat and still in every picture?",
            found.fit.over_noise,
        )
    for name, value, variance in zip(
        ("focal length, px", "axis x, px", "axis y, px", "k1", "k2", "p1", "p2", "k3"),
        lens.parameters, lens.covariance.diagonal(), strict=True,
    ):  # fmt: skip
        if variance > 0:
            yield Message("  {name:<17} {value:.6g} ± {sigma:.2g}", word(name), value, variance**0.5)
    size = int(min(SHOWN_ZOI, width, height))
    grid = ZoiGrid.cover(Roi(int(x), int(y), int(width), int(height)), size, SHOWN_STEP)
    yield Message("over the calibrated part, {what}", lens_words(lens, grid))


def _pictures(arguments: argparse.Namespace) -> Iterator[np.ndarray]:
    """Every picture of the source.

    Raises
    ------
    ConfigError
        It is a live camera, which does not end.
    """
    from live.setup.pictures import camera_of, whole_frames

    with camera_of(with_scheme(arguments.source)) as camera:
        if camera.info.live:
            raise ConfigError(
                "{source}: give recorded pictures of the board, as 'board/*.png'", arguments.source
            )
        yield from (frame.image for frame in whole_frames(camera))


def _of_specimen(arguments: argparse.Namespace, screen: Screen) -> LensCalibration:
    from live.replay.opening import fields_of, open_source
    from live.replay.source import ReplayRequest

    file = Path(arguments.config) if arguments.config else None
    with open_source(ReplayRequest(arguments.source, file, _alone(arguments))) as (source, config):
        fields = [field for _, field in fields_of(source, config, arguments.source, screen)]
    chosen = fields[:: -(-len(fields) // MAX_SHIFTS) or 1]
    return from_shifts(chosen, source.camera.width, source.camera.height, square=arguments.square_on)


def _alone(arguments: argparse.Namespace) -> dict[str, Any]:
    """The settings of the command line, for ZOIs side by side and displacements as the picture shows them."""
    given = overrides(arguments)
    file = settings_in(Path(arguments.config)) if arguments.config else {}
    zoi = given.get("measure.zoi", file.get("measure.zoi", load_config(None, {}).measure.zoi))
    return {
        **given, "measure.zoi": zoi, "measure.step": zoi, "measure.strain": "small", "measure.renew_at": 1.0,
        "measure.order": 1, "lens": {}, "plate": {}, "gauges": {}, "alarm": [],
    }  # fmt: skip
