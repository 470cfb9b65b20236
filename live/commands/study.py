"""``phasedic study``: measure one test with many settings, and recommend one."""

from __future__ import annotations

import argparse
import dataclasses
import itertools
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from acquire.errors import ConfigError
from acquire.text import Message
from live.commands import options
from live.commands.arguments import bad_value
from live.config.new_files import check_free, new_folder
from live.config.values import AUTO, numbers_of
from live.results.report.saving import save_figures
from live.results.report.svg import Plot, PlotLine
from live.setup.compiling import compile_ahead
from live.ui.terminal.screen import TerminalScreen

if TYPE_CHECKING:
    from live.replay.study import Advice, StudyResult, StudySetting

MEASURE = ("roi", "mask", "burst", "reference-burst", "estimator", "strain", "bending", "noise", "axis")
WINDOWS = ("gaussian", "uniform", "tukey", "bi-triangular")

_HEAD = Message(
    "  zoi step order window        l10 px  VSG px  noise µm/m  over predicted  strain µm/m     ±"
    "  gradient µm/m/px  valid"
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``phasedic study``."""
    parser.add_argument("source", help="session.h5, or pictures as for replay")
    parser.add_argument(
        "--zoi",
        type=_numbers,
        default=[24, 32, 48, 64, 96],
        metavar="PX,PX",
        help="sides of ZOIs (24,32,48,64,96)",
    )
    parser.add_argument(
        "--step", type=_numbers, metavar="PX,PX", help="distances of ZOIs (default: a quarter of the side)"
    )
    options.add_picture_order(parser, _numbers, default=[1])
    parser.add_argument(
        "--window",
        type=_windows,
        default=["gaussian"],
        metavar="NAME,NAME",
        help="weights: gaussian, uniform, tukey, bi-triangular (default gaussian)",
    )
    words = "time without motion, s (default: from the force)"
    words += "; none: no such time, the noise is predicted"
    parser.add_argument("--static", type=_still, metavar="A,B", help=words)
    words = "time under load, s (default: around the highest force)"
    parser.add_argument("--loaded", type=_seconds, metavar="C,D", help=words)
    words = "new folder for table, figures and measure.toml"
    parser.add_argument(
        "--out", dest="folder", default="study", metavar="DIR", help=f"{words} (default study)"
    )
    options.add_config_file(parser)
    options.add_options(parser, "measurement", *MEASURE)
    options.add_verbose(parser)
    options.add_help_all(parser)


def command(arguments: argparse.Namespace) -> int:
    """``phasedic study``."""
    from live.replay.opening import open_source
    from live.replay.source import ReplayRequest
    from live.replay.study import recommended, study, take_windows
    from live.setup.dry_run import picture_kinds

    screen, out = TerminalScreen(), Path(arguments.folder)
    check_free(out)
    settings, found = _settings(arguments), []
    config_file = Path(arguments.config) if arguments.config else None
    source = options.in_picture_order(arguments.source, arguments.picture_order)
    request = ReplayRequest(source, config_file, options.overrides(arguments), reference=arguments.reference)
    with open_source(request) as (material, config):
        screen.print(material.words)
        if AUTO in (config.measure.roi, config.measure.gauges):
            raise ConfigError(
                "a study does not look for the specimen; give --roi x,y,width,height or all, or the --mask that"
                " 'phasedic replay' leaves beside its results"
            )
        compile_ahead(
            picture_kinds(material.camera), phase=config.measure.estimator == "phase", screen=screen
        )
        windows = take_windows(material, arguments.static, arguments.loaded)
        screen.print(
            Message(
                "settings: {n}; bursts of {source}: {still} still, {loaded} loaded",
                *(len(settings), arguments.source, len(windows.still), len(windows.loaded)),
            )
        )
        screen.print(_HEAD)
        for one in study(material, windows, config, settings):
            found.append(one)
            screen.print(_line(one))
    advice = recommended(found)
    with new_folder(out) as part:
        (part / "study.csv").write_text(_csv(found), encoding="utf-8")
        (part / "measure.toml").write_text(_section(advice), encoding="utf-8")
        save_figures(_figures(found), part / "figures", screen)
    screen.print(Message("take {setting}: {why}", advice.found.setting.words, advice.why))
    screen.print(_section(advice).rstrip())
    screen.print(f"  {out}")
    return 0


def _settings(arguments: argparse.Namespace) -> list[StudySetting]:
    from live.replay.study import StudySetting

    found = [
        StudySetting(zoi, step, order, window)
        for zoi, order, window in itertools.product(arguments.zoi, arguments.order, arguments.window)
        for step in arguments.step or [max(1, zoi // 4)]
    ]
    return list(dict.fromkeys(found))


# -- output -------------------------------------------------------------------------------------


def _line(one: StudyResult) -> str:
    s = one.setting
    mark = "" if one.is_significant else Message("  noise")
    over = f"{one.noise / one.predicted:.2f}" if one.measured else "-"
    return (
        f"{s.zoi:5d} {s.step:4d} {s.order:5d} {s.window:12s} {one.l10:7.1f} {one.vsg:7.1f} {one.noise * 1e6:11.1f}"
        f" {over:>15s} {one.seen * 1e6:12.0f} {one.sigma * 1e6:5.0f}"
        f" {one.gradient * 1e6:17.1f} {one.valid:6.0%}{mark}"
    )


def _csv(found: Sequence[StudyResult]) -> str:
    rows = [{**dataclasses.asdict(one.setting), **_values(one)} for one in found]
    lines = [",".join(rows[0]), *(",".join(f"{value:.8g}" if isinstance(value, float) else str(value)
             for value in row.values()) for row in rows)]  # fmt: skip
    return "\n".join(lines) + "\n"


def _values(one: StudyResult) -> dict[str, Any]:
    values = {name: getattr(one, name) for name in ("l10", "vsg", "noise", "predicted", "seen", "sigma")}
    return {**values, "gradient": one.gradient, "valid": one.valid}


def _section(advice: Advice) -> str:
    s = advice.found.setting
    return f'[measure]\nzoi = {s.zoi}\nstep = {s.step}\norder = {s.order}\nwindow = "{s.window}"\n'


def _figures(found: Sequence[StudyResult]) -> list[Plot]:
    """Noise and strain over the size of the virtual gauge, one line per order and weight."""
    kinds = list(dict.fromkeys((one.setting.order, one.setting.window) for one in found))
    parts = [[one for one in found if (one.setting.order, one.setting.window) == kind] for kind in kinds]
    names = [f"order {order}, {window}" for order, window in kinds]
    noise = tuple(
        _curve(name, part, "noise", k) for k, (name, part) in enumerate(zip(names, parts, strict=True))
    )
    seen = tuple(
        _curve(name, part, "seen", k) for k, (name, part) in enumerate(zip(names, parts, strict=True))
    )
    x = "size of the virtual gauge, px"
    return [
        Plot("noise", "Noise of one ZOI", x, "noise, µm/m", noise),
        Plot("strain", "Largest strain, corrected for its noise", x, "strain, µm/m", seen),
    ]


def _curve(name: str, part: Sequence[StudyResult], value: str, colour: int) -> PlotLine:
    part = sorted(part, key=lambda one: one.vsg)
    x, y = np.array([one.vsg for one in part]), np.array([getattr(one, value) * 1e6 for one in part])
    sigma = np.array([one.sigma * 1e6 for one in part]) if value == "seen" else None
    return PlotLine(name, x, y, sigma, colour)


# -- arguments ----------------------------------------------------------------------------------


def _numbers(word: str) -> list[int]:
    try:
        found = numbers_of(word, int)
    except ValueError:
        raise bad_value("{given}: give whole numbers, as 24,32,48", repr(word)) from None
    if min(found) < 1:
        raise bad_value("{given}: give numbers from 1", repr(word))
    return found


def _windows(word: str) -> list[str]:
    for part in word.split(","):
        if part not in WINDOWS:
            raise bad_value("{given}: there are {known}", repr(part), ", ".join(WINDOWS))
    return word.split(",")


def _still(word: str) -> tuple[float, float]:
    from live.replay.study import NO_WINDOW

    return NO_WINDOW if word == "none" else _seconds(word)


def _seconds(word: str) -> tuple[float, float]:
    try:
        low, high = numbers_of(word, float, 2)
    except ValueError:
        raise bad_value("{given}: give two numbers, as 0,1.5", repr(word)) from None
    if not low < high:
        raise bad_value("{given}: the first must be the smaller", repr(word))
    return low, high
