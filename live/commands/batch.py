"""``phasedic batch``: many sessions or folders of pictures, replayed by workers."""

from __future__ import annotations

import argparse
import math
import os
import threading
from pathlib import Path

from acquire.errors import ConfigError
from live.commands.exit_codes import EXIT_WORDS
from live.commands.options import MEASURE, add_options, add_verbose, overrides
from live.commands.signals import signals
from live.ui.terminal.screen import TerminalScreen

OUTPUT = ("axis", "standard", "zero", "lag")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``phasedic batch``."""
    words = "sessions, folders of pictures, quoted globs such as 'runs/*/session.h5', or a list (.toml, .csv)"
    parser.add_argument("tests", nargs="+", metavar="TEST", help=words)
    words = (
        "a folder for each test is made in it, and summary.csv; called again, only what is missing is done"
    )
    parser.add_argument("--out", dest="folder", required=True, metavar="DIR", help=words)
    parser.add_argument(
        "--workers", type=int, default=_cores(), metavar="N", help="processes (default: one a core)"
    )
    words = "a running Dask cluster in place of --workers, as tcp://HOST:PORT (extra cluster)"
    parser.add_argument("--scheduler", metavar="ADDRESS", help=words)
    words = (
        "cut longer sessions into chunks of S seconds, for several workers; differs by less than 0.005 sigma"
    )
    parser.add_argument("--chunk", dest="chunk_s", type=float, metavar="S", help=words)
    parser.add_argument("--as-measured", action="store_true", help="the bursts of the live runs, bit-equal")
    parser.add_argument("--from", dest="start_s", type=float, metavar="S", help="begin here, seconds")
    parser.add_argument("--to", dest="end_s", type=float, metavar="S", help="end here, seconds")
    parser.add_argument("--config", metavar="FILE", help="TOML file; what is given here overrides it")
    add_options(parser, "measurement", *MEASURE)
    add_options(parser, "evaluation", *OUTPUT)
    parser.add_argument("--section", metavar="W,T", help="width,thickness of the section in mm, for stresses")
    parser.add_argument(
        "--meta", action="append", default=[], metavar="KEY=TEXT", help="stored in every file"
    )
    add_verbose(parser)


def command(arguments: argparse.Namespace) -> int:
    """``phasedic batch``; 5 where a test failed or has losses."""
    from live.replay.batch.campaign import CampaignRequest, run_campaign
    from live.replay.batch.test_list import find_tests

    if arguments.workers < 1:
        raise ConfigError(f"--workers {arguments.workers} is not possible; allowed: from 1")
    wanted = CampaignRequest(
        tests=find_tests(arguments.tests),
        out=Path(arguments.folder),
        workers=arguments.workers,
        config=arguments.config,
        overrides=overrides(arguments),
        start_s=arguments.start_s,
        end_s=arguments.end_s,
        as_measured=arguments.as_measured,
        chunk_s=_chunk_s(arguments),
        scheduler=arguments.scheduler,
    )
    screen, stopping = TerminalScreen(), threading.Event()
    with signals(stopping.set, screen.say):
        done = run_campaign(wanted, screen, stopping)
    for path in done.files:
        screen.say(f"  {path}")
    if done.exit_code == 5:
        screen.say("exit code 5: tests failed or have losses; the column error tells")
    elif done.exit_code in EXIT_WORDS:
        screen.say("exit code 130: interrupted; what is whole is kept, the same call does the rest")
    return done.exit_code


def _chunk_s(arguments: argparse.Namespace) -> float | None:
    chunk_s: float | None = arguments.chunk_s
    if chunk_s is not None and not (math.isfinite(chunk_s) and chunk_s > 0):
        raise ConfigError(f"--chunk {chunk_s} is not possible; allowed: seconds above 0")
    if chunk_s is not None and arguments.as_measured:
        raise ConfigError(
            "--as-measured is bit-equal to the live run, which chunks are not; leave --chunk out"
        )
    return chunk_s


def _cores() -> int:
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:  # not on every system
        return os.cpu_count() or 1
