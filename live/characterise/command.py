"""``phasedic characterise``: the accuracy of the measurement, on rendered truth or on a pattern of the user.

Each experiment is a function that returns an ``ExperimentOutcome``. Outcomes are stored in the output folder, so
an interrupted run continues. ``--pattern`` characterises a picture (live.characterise.own_pattern).
"""

from __future__ import annotations

import argparse
import hashlib
import importlib
import sys
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import TextIO

from acquire.errors import ConfigError, DataError
from live.characterise.outcome import (
    ExperimentContext,
    ExperimentOutcome,
    ProgressBar,
    figure,
    read_outcome,
    write_outcome,
)
from live.characterise.page import write_page
from live.pipeline.reference import on_fit_machine

Experiment = Callable[[ExperimentContext], ExperimentOutcome]
EXPERIMENTS: Mapping[str, tuple[str, str]] = MappingProxyType({
    "fig1": ("live.characterise.experiments.figures", "fig1"),
    "table1": ("live.characterise.experiments.table1", "table1"),
    "resolution": ("live.characterise.experiments.resolution", "resolution"),
    "table2": ("live.characterise.experiments.table2", "table2"),
    "fig3": ("live.characterise.experiments.figures", "fig3"),
    "section41": ("live.characterise.experiments.section41", "section41"),
    "woven": ("live.characterise.experiments.woven", "woven"),
    "open-hole": ("live.characterise.experiments.woven", "open_hole"),
    "burst": ("live.characterise.experiments.burst", "burst"),
    "peers": ("live.characterise.experiments.peers", "peers"),
})  # fmt: skip
"""Name -> module and function, in the order of the page."""
PAGE = "characterisation.md"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``phasedic characterise``."""
    parser.add_argument(
        "--out", required=True, metavar="DIR", help="folder of the page, figures and CSV files"
    )
    parser.add_argument("--quick", action="store_true", help="about a minute, with fewer ZOIs and cases")
    parser.add_argument("--only", nargs="+", metavar="NAME", help=f"some of: {', '.join(EXPERIMENTS)}")
    parser.add_argument("--data", metavar="DIR", help="folder of the DIC Challenge image sets")
    parser.add_argument("--page", metavar="FILE", help=f"where the page goes (default DIR/{PAGE})")
    own = parser.add_argument_group("your own pattern")
    own.add_argument("--pattern", metavar="FILE", help="characterise this picture instead")
    own.add_argument(
        "--noise", type=float, metavar="GL", help="noise of one frame (default: from its spectrum)"
    )
    own.add_argument(
        "--burst", type=int, metavar="N", help="frames averaged in a test (default: 1, 4, 16, 64)"
    )
    own.add_argument("--roi", metavar="X,Y,W,H", help="part of the picture, px")
    own.add_argument(
        "--target", type=float, default=100.0, metavar="UM/M", help="wanted strain noise (default 100)"
    )


def command(arguments: argparse.Namespace) -> int:
    """``phasedic characterise``; returns the exit code.

    Raises
    ------
    ConfigError
        An unknown name, or no matplotlib.
    DataError
        A folder that cannot be written, or a picture that cannot be read.
    MachineUnfit
        The machine measures a known pattern wrong.
    """
    with on_fit_machine():
        return _characterise(arguments)


def _characterise(arguments: argparse.Namespace) -> int:
    figure(1, 1)  # a missing matplotlib ends the command before the work
    folder = _made(Path(arguments.out))
    if arguments.pattern:
        from live.characterise.own_pattern import characterise_pattern

        return characterise_pattern(arguments, folder)
    names = chosen(arguments.only)
    data = _data(arguments.data)
    outcomes = run(names, ExperimentContext(folder, arguments.quick, data), screen=sys.stderr)
    target = Path(arguments.page) if arguments.page else folder / PAGE
    write_page(outcomes, target, folder, _as_typed(arguments))
    print(f"page: {target}")
    return 0


def chosen(only: Iterable[str] | None) -> list[str]:
    """The requested experiments, in the order of the page.

    Raises
    ------
    ConfigError
        There is no such experiment.
    """
    wanted = list(EXPERIMENTS) if only is None else list(only)
    unknown = [name for name in wanted if name not in EXPERIMENTS]
    if unknown:
        raise ConfigError(f"--only {' '.join(unknown)}: not known; there are {', '.join(EXPERIMENTS)}")
    return [name for name in EXPERIMENTS if name in wanted]


def run(
    names: Iterable[str], context: ExperimentContext, screen: TextIO | None = None
) -> list[ExperimentOutcome]:
    """Run the experiments, or take the stored outcomes of an earlier run with the same key."""
    key = run_key(context)
    outcomes = []
    for name in names:
        outcome = read_outcome(name, context.folder, key)
        progress = ProgressBar(name, screen)
        if outcome is None:
            outcome = _timed(name, replace(context, tick=progress))
            write_outcome(outcome, context.folder, key)
            progress.done(f"{outcome.seconds:.1f} s")
        else:
            progress.done("stored")
        outcomes.append(outcome)
    return outcomes


def _timed(name: str, context: ExperimentContext) -> ExperimentOutcome:
    module, function = EXPERIMENTS[name]
    experiment: Experiment = getattr(importlib.import_module(module), function)
    begin = time.monotonic()
    return replace(experiment(context), name=name, seconds=time.monotonic() - begin)


def run_key(context: ExperimentContext) -> str:
    """The key of stored outcomes: the code, the extent and the data they were made with."""
    digest = hashlib.sha256()
    root = Path(__file__).parents[2]
    packages = ("analysis", "hw_mocks", "live/characterise")
    sources = [path for package in packages for path in (root / package).rglob("*.py")]
    for path in sorted(sources):
        digest.update(path.read_bytes())
    return f"{digest.hexdigest()[:16]} {'quick' if context.quick else 'whole'} {context.data or 'no data'}"


def _made(folder: Path) -> Path:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise DataError(f"{folder} cannot be made: {error.strerror}; give another --out") from error
    return folder


def _data(given: str | None) -> Path | None:
    if given is None:
        return None
    if not Path(given).is_dir():
        raise ConfigError(f"--data {given}: there is no such folder")
    return Path(given)


def _as_typed(arguments: argparse.Namespace) -> str:
    words = ["phasedic characterise"]
    words += ["--quick"] * arguments.quick
    words += ["--only", *arguments.only] if arguments.only else []
    words += ["--data DIR"] if arguments.data else []
    return " ".join(
        [*words, f"--out {arguments.out}", *([f"--page {arguments.page}"] if arguments.page else [])]
    )
