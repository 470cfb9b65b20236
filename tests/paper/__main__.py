"""``make paper``: the paper reproduced on rendered truth and real pictures, with the kernel beside its estimator.

Each experiment is a function that returns an ``ExperimentOutcome``. Outcomes are stored in the output folder, so
an interrupted run continues.
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

from acquire.errors import ConfigError, PhasedicError
from live.commands.characterise import made_folder
from live.setup.pattern.outcome import (
    ExperimentContext,
    ExperimentOutcome,
    ProgressBar,
    figure,
    write_outcome,
)
from tests.paper.outcomes import read_outcome, write_page

INTRODUCTION = """The accuracy of phase-DIC, on rendered truth and on real pictures, compared with its paper:
J. Molimard, *Implementation of the direct evaluation of strains in a frequency-based image analysis code for random
patterns*. Three columns run through the page: the figure the paper prints; the paper's own estimator as we read it
(one shot, bi-triangular window for the displacement, Gaussian for the strain, errata mended:
`tests/paper/estimator.py`); and ours, the kernel with its default settings.

Assumed where the paper gives nothing: speckle is a sum of Gaussian blobs exp(-rho^2/(2 r^2)) of either sign, r
being "the radius", with a standard deviation of 18 % of full scale and no clipped pixels; noise is white, and "31 GL"
its standard deviation unless a section says otherwise; a frequency is usable from 5 % of the largest amplitude of its
ZOI; the pseudo-inverse is unweighted; the strain comes from the derivatives of the phases of all usable frequencies
together, by least squares with six in-situ sensitivities. Truth is rendered analytically in the deformed place, no
picture is interpolated. docs/method.md derives the estimators.

The accuracy of your own pattern: `phasedic characterise --pattern reference.tif --noise GL --out DIR`. One ZOI of a
recorded session: `phasedic inspect session.h5 --zoi R,C --frame N`.
"""

Experiment = Callable[[ExperimentContext], ExperimentOutcome]
EXPERIMENTS: Mapping[str, tuple[str, str]] = MappingProxyType({
    "fig1": ("tests.paper.figures", "fig1"),
    "table1": ("tests.paper.table1", "table1"),
    "resolution": ("tests.paper.resolution", "resolution"),
    "table2": ("tests.paper.table2", "table2"),
    "fig3": ("tests.paper.figures", "fig3"),
    "section41": ("tests.paper.section41", "section41"),
    "woven": ("tests.paper.woven", "woven"),
    "open-hole": ("tests.paper.woven", "open_hole"),
    "burst": ("tests.paper.burst", "burst"),
    "peers": ("tests.paper.peers", "peers"),
})  # fmt: skip
"""Name -> module and function, in the order of the page."""
PAGE = "characterisation.md"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``python -m tests.paper``."""
    parser.add_argument(
        "--out", required=True, metavar="DIR", help="folder of the page, figures and CSV files"
    )
    parser.add_argument("--quick", action="store_true", help="about a minute, with fewer ZOIs and cases")
    parser.add_argument("--only", nargs="+", metavar="NAME", help=f"some of: {', '.join(EXPERIMENTS)}")
    parser.add_argument("--data", metavar="DIR", help="folder of the DIC Challenge image sets")
    parser.add_argument("--page", metavar="FILE", help=f"where the page goes (default DIR/{PAGE})")


def command(arguments: argparse.Namespace) -> int:
    """Reproduce the paper; raises ConfigError and DataError as ``live.commands.characterise``."""
    figure(1, 1)  # a missing matplotlib ends the command before the work
    folder = made_folder(Path(arguments.out))
    names = chosen(arguments.only)
    data = _data(arguments.data)
    outcomes = run(names, ExperimentContext(folder, arguments.quick, data), screen=sys.stderr)
    target = Path(arguments.page) if arguments.page else folder / PAGE
    write_page(outcomes, target, folder, _as_typed(arguments), INTRODUCTION)
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
    packages = ("analysis", "hw_mocks", "live/setup/pattern", "tests/paper")
    sources = [path for package in packages for path in (root / package).rglob("*.py")]
    for path in sorted(sources):
        digest.update(path.read_bytes())
    return f"{digest.hexdigest()[:16]} {'quick' if context.quick else 'whole'} {context.data or 'no data'}"


def _data(given: str | None) -> Path | None:
    if given is None:
        return None
    if not Path(given).is_dir():
        raise ConfigError(f"--data {given}: there is no such folder")
    return Path(given)


def _as_typed(arguments: argparse.Namespace) -> str:
    words = ["python -m tests.paper"]
    words += ["--quick"] * arguments.quick
    words += ["--only", *arguments.only] if arguments.only else []
    words += ["--data DIR"] if arguments.data else []
    return " ".join(
        [*words, f"--out {arguments.out}", *([f"--page {arguments.page}"] if arguments.page else [])]
    )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(prog="python -m tests.paper", description=__doc__)
    add_arguments(parser)
    try:
        sys.exit(command(parser.parse_args()))
    except PhasedicError as error:
        sys.exit(f"{parser.prog}: {error}")
