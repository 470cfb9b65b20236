"""The options of the command line that set keys of the configuration.

An option is declared with its key in ``live.config.sections``: name, type, default and help stand once. Its value
is stored under "section.key".

Report, show and export have ``--gauges`` in common: gauges added to a finished run, read from its stored maps.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from acquire.addresses import parse_address, with_setting
from acquire.bounds import NotAllowed, integer_of, number_of, positive
from acquire.camera import with_scheme
from acquire.errors import ConfigError
from acquire.text import Message, word
from analysis.evaluate import Gauge, GaugeSet
from live.commands.arguments import HELP_ALL, bad_value, not_empty
from live.config.gauges import gauges_for
from live.config.loading import Config, lens_in, load_config, options
from live.config.new_files import check_free
from live.config.values import numbers_of
from live.results.layout import gauge_columns
from live.results.run_folder import RunFolder

MEASURE = (
    "roi", "mask", "zoi", "step", "gauges", "scale", "burst", "reference-burst", "window", "estimator", "strain",
    "order", "bending", "noise",
)  # fmt: skip
OUTPUT = (
    "out", "no-view", "no-rrd", "light", "axis", "standard", "test", "zero", "lag", "response", "report",
)  # fmt: skip
FORCES = ("load-unit", "load-column", "load-decimal", "load-sign")
PICTURES = (".png", ".tif")
PICTURE_ORDERS = ("name", "time")
OF_PICTURES = tuple(name for name in MEASURE if name != "order")
"""``MEASURE`` for commands with ``add_picture_order``."""


def add_options(parser: argparse.ArgumentParser, title: str, *names: str) -> None:
    """Add a group of options by their names."""
    group, known = parser.add_argument_group(title), options()
    for name in names:
        key, field = known[name]
        option, check = field.metadata["option"], field.metadata["check"]
        words = field.metadata["help"]
        if option.off or option.on:
            words = Message("do not {what}", word(words)) if option.off else words
            group.add_argument(f"--{name}", dest=key, action="store_const", const=option.on, help=words)
            continue
        if field.default not in (None, "", ()):
            words = Message("{words} (default {value})", word(words), str(field.default))
        shape = {"metavar": option.metavar} if option.metavar else {"choices": check.words}
        again: Any = {"action": "append"} if option.many else {}
        alone: Any = {"nargs": "?", "const": option.alone} if option.alone else {}
        group.add_argument(
            f"--{name}", dest=key, type=_reader(check.read), help=words, **shape, **again, **alone
        )


def _reader(read: Any) -> Any:
    """``read`` with a clear message for a value it rejects."""

    def reader(word: str) -> Any:
        try:
            return read(not_empty(word))
        except ValueError as error:
            kind = {int: Message("a whole number"), float: Message("a number")}.get(read)
            text = Message("{given}: give {kind}", repr(word), kind) if kind else error
            raise bad_value("{text}", text) from None

    return reader


def number(low: float = -math.inf, high: float = math.inf) -> Any:
    """What reads an option that is a finite number within bounds."""
    return _bounded(lambda word: number_of(word, low, high))


def whole(low: float = -math.inf, high: float = math.inf) -> Any:
    """What reads an option that is a whole number within bounds."""
    return _bounded(lambda word: integer_of(word, low, high))


def _bounded(read: Any) -> Any:
    def reader(word: str) -> Any:
        try:
            return read(word)
        except NotAllowed as allowed:
            raise bad_value("{given}: give {kind}", repr(word), allowed.text) from None

    return reader


POSITIVE = _bounded(positive)
"""What reads an option that is a number above 0."""


class _Order(argparse.Action):
    """``--order``: name or time of pictures, or the order of the shape function, each in its place."""

    def __call__(
        self, parser: argparse.ArgumentParser, namespace: argparse.Namespace, values: Any, *_: Any
    ) -> None:
        setattr(namespace, "picture_order" if values in PICTURE_ORDERS else self.dest, values)


def add_picture_order(parser: argparse.ArgumentParser, read: Any = int, **more: Any) -> None:
    """Add --reference, and --order for pictures and, by ``read``, for shape functions."""
    words = "picture that the others are compared with, of the source or any other (default: the first)"
    parser.add_argument("--reference", metavar="NAME", help=words)
    words = "order of pictures where their names do not say it: name or time; or of the shape function of a ZOI: 1 or 2"
    reader = lambda word: word if word in PICTURE_ORDERS else read(word)  # noqa: E731
    parser.add_argument(
        "--order", action=_Order, type=_reader(reader), metavar="name|time|N", help=words, **more
    )
    parser.set_defaults(picture_order=None)


def in_picture_order(source: str, order: str | None) -> str:
    """The address of pictures with the ``order`` that was given; raises ConfigError for other sources."""
    if order is None:
        return source
    if parse_address(with_scheme(source)).scheme != "files":
        raise ConfigError(
            "--order {order}: {source} has an order of its own; it is for pictures in files", order, source
        )
    return with_setting(source, "order", order)


def add_measure(parser: argparse.ArgumentParser, *output: str, measure: Sequence[str] = MEASURE) -> None:
    """Add the options of ``measure``, and ``output``: by default all of ``OUTPUT``."""
    add_config_file(parser)
    add_options(parser, "measurement", *measure)
    add_options(parser, "output", *(output or OUTPUT))
    add_section(parser)
    add_lens(parser)
    add_metadata(parser)
    add_verbose(parser)
    add_help_all(parser)


def add_lens(parser: argparse.ArgumentParser) -> None:
    """Add --lens and --no-lens."""
    group = parser.add_mutually_exclusive_group()
    group.add_argument("--lens", metavar="FILE", help="correct the lens that phasedic lens calibrated")
    group.add_argument("--no-lens", action="store_true", help="do not correct the lens of the configuration")


def add_help_all(parser: argparse.ArgumentParser) -> None:
    """Add --help-all, for a command with expert options."""
    parser.add_argument(HELP_ALL, action="help", help="this help, with the options for experts")


def add_config_file(
    parser: argparse.ArgumentParser, words: str = "TOML file of the configuration; options override it"
) -> None:
    """Add --config."""
    parser.add_argument("--config", metavar="FILE", help=words)


def add_section(parser: argparse.ArgumentParser) -> None:
    """Add --section."""
    words = "width,thickness of the section in mm, for stresses"
    parser.add_argument("--section", metavar="W,T", help=words)


def add_metadata(parser: argparse.ArgumentParser) -> None:
    """Add --meta."""
    words = "metadata, stored in every file; may be repeated"
    parser.add_argument("--meta", action="append", default=[], metavar="KEY=TEXT", help=words)


def add_time_span(parser: argparse.ArgumentParser) -> None:
    """Add --from and --to."""
    parser.add_argument("--from", dest="start_s", type=number(0), metavar="S", help="begin at this time, s")
    parser.add_argument("--to", dest="end_s", type=number(0), metavar="S", help="end at this time, s")


def add_as_measured(parser: argparse.ArgumentParser) -> None:
    """Add --as-measured."""
    words = "use the bursts of the live run; results are bit-identical where all were recorded"
    parser.add_argument("--as-measured", action="store_true", help=words)


def add_gauge_option(parser: argparse.ArgumentParser) -> None:
    """Add --gauges for commands on a finished run."""
    words = "additional virtual gauges: a TOML file with tables [gauges.NAME]"
    parser.add_argument("--gauges", dest="more_gauges", metavar="FILE.toml", help=words)


def require_new(path: Path, *endings: str) -> None:
    """Raises ConfigError if the file exists, its folder does not, or its name ends in none of ``endings``."""
    check_free(path)
    if not path.parent.is_dir():
        raise ConfigError(
            "{path}: there is no folder {folder}; make it, or choose another name", path, path.parent
        )
    if endings and path.suffix.lower() not in endings:
        raise ConfigError(
            "{path}: no such picture can be written; end its name in {endings}", path, " or ".join(endings)
        )


def add_verbose(parser: argparse.ArgumentParser) -> None:
    """Add --verbose."""
    parser.add_argument("--verbose", "-v", action="store_true", help="detailed log messages")


def overrides(arguments: argparse.Namespace) -> dict[str, Any]:
    """The values that the command line sets, "section.key" -> value."""
    given = vars(arguments)
    found = {key: value for key, value in given.items() if "." in key and value is not None}
    if given.get("section"):
        found |= _section(given["section"])
    if given.get("lens") or given.get("no_lens"):
        found["lens"] = lens_in(Path(given["lens"])) if given["lens"] else {}
    for pair in given.get("meta") or ():
        key, _, value = pair.partition("=")
        found[f"metadata.{key}"] = value
    return found


def configured(arguments: argparse.Namespace, defaults: dict[str, Any] | None = None) -> Config:
    """The configuration: ``defaults``, overridden by the file of --config, overridden by the options."""
    path = Path(arguments.config) if arguments.config else None
    return load_config(path, {**(defaults or {}), **overrides(arguments)})


def _section(text: str) -> dict[str, float]:
    try:
        width, thickness = numbers_of(text, float, 2)
    except ValueError:
        raise ConfigError(
            "--section {given}: give width,thickness in mm, for example 10,2; of another section "
            "specimen.diameter_mm or specimen.area_mm2 in the file of --config",
            text,
        ) from None
    return {"specimen.width_mm": width, "specimen.thickness_mm": thickness}


def add_gauges(run: RunFolder, path: Path) -> tuple[str, ...]:
    """Add the ``[gauges.NAME]`` of a TOML file to ``run`` while it is open; its files stay as they are.

    Values are those that a replay with this file would give, to the digits of the maps, and so are the uncertainties of
    extensometers and single ZOIs. That of an area includes only the overlap of the windows (6 % low at a step of a
    quarter of a ZOI, a third at most). Files of earlier versions have no normal matrices: there the ZOIs of an area
    weigh as those of a pattern that is everywhere alike. A gauge replaces an existing one of the same name.

    Raises
    ------
    ConfigError
        The file cannot be read, holds no gauge, or no ZOI lies at a gauge.
    DataError
        The maps cannot be read.
    """
    config = load_config(path, {"specimen.axis": run.specimen.axis})
    if not config.gauges:
        raise ConfigError("{path}: holds no gauge; give a table [gauges.NAME] each", path)
    gauges, strain = gauges_for(config.gauges, config.specimen.first_axis, run.strain.grid), run.strain
    values, sigmas = _read(run, gauges)
    stored = run.section("gauges")
    strain.config["gauges"] = {**stored, **config.gauges}
    for k, gauge in enumerate(gauges):
        strain.values |= dict(zip(gauge_columns(gauge.name)[:2], (values[:, k], sigmas[:, k]), strict=True))
    run.__dict__.pop("gauges", None)  # the cached value is out of date
    return tuple(gauge.name for gauge in gauges)


def _read(run: RunFolder, gauges: tuple[Gauge, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Values and sigmas, (T, number of gauges) each."""
    gauge_set = GaugeSet(gauges)
    read = [gauge_set.read(run.field(row)).values() for row in range(run.strain.n)]
    found = np.array([[(one.value, one.sigma) for one in row] for row in read]).reshape(-1, len(gauges), 2)
    return found[..., 0], found[..., 1]
