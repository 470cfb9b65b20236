"""``phasedic batch``: replay many sessions or folders of pictures in parallel."""

from __future__ import annotations

import argparse
import threading
from dataclasses import replace
from pathlib import Path

from acquire.errors import EXIT_WORDS, LOSS, ConfigError
from acquire.system import cores
from acquire.text import Message
from live.commands import options
from live.commands.process import signals
from live.config.effect import check_forces
from live.ui.terminal.screen import TerminalScreen

OUTPUT = ("axis", "standard", "test", "zero", "lag")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``phasedic batch``."""
    words = "sessions, folders of pictures, quoted globs such as 'runs/*/session.h5', or a list (.toml, .csv)"
    parser.add_argument("tests", nargs="+", metavar="TEST", help=words)
    words = "folder for summary.csv and a folder for each test; the same call again does only what is missing"
    parser.add_argument("--out", dest="folder", required=True, metavar="DIR", help=words)
    parser.add_argument(
        "--workers",
        type=options.whole(1),
        default=cores(),
        metavar="N",
        help="number of processes (default: one per core)",
    )
    words = "scheduler of a running Dask cluster instead of --workers: tcp://HOST:PORT (extra cluster)"
    parser.add_argument("--scheduler", metavar="ADDRESS", help=words)
    words = "split longer sessions into chunks of S seconds for several workers (differs by less than 0.005 sigma)"
    parser.add_argument("--chunk", dest="chunk_s", type=options.POSITIVE, metavar="S", help=words)
    options.add_as_measured(parser)
    options.add_time_span(parser)
    options.add_config_file(parser)
    options.add_picture_order(parser, dest="measure.order")
    options.add_options(parser, "measurement", *options.OF_PICTURES)
    options.add_options(parser, "evaluation", *OUTPUT)
    options.add_options(parser, "files of forces", *options.FORCES)
    options.add_section(parser)
    options.add_metadata(parser)
    options.add_verbose(parser)
    options.add_help_all(parser)


def command(arguments: argparse.Namespace) -> int:
    """``phasedic batch``; 5 if a test failed or has losses."""
    from live.replay.batch.campaign import CampaignRequest, run_campaign
    from live.replay.batch.test_list import find_tests

    if arguments.chunk_s is not None and arguments.as_measured:
        raise ConfigError(
            "--as-measured is bit-identical to the live run and chunks are not; leave --chunk out"
        )
    tests, given = find_tests(arguments.tests), options.overrides(arguments)
    if not any(test.forces for test in tests):
        check_forces(given, Message("a list of tests with their files of forces"))
    request = CampaignRequest(
        tests=[
            replace(test, source=options.in_picture_order(test.source, arguments.picture_order))
            for test in tests
        ],
        reference=arguments.reference,
        out=Path(arguments.folder),
        workers=arguments.workers,
        config=arguments.config,
        overrides=given,
        start_s=arguments.start_s,
        end_s=arguments.end_s,
        as_measured=arguments.as_measured,
        chunk_s=arguments.chunk_s,
        scheduler=arguments.scheduler,
    )
    screen, stopping = TerminalScreen(), threading.Event()
    with signals(stopping.set, screen):
        done = run_campaign(request, screen, stopping)
    for path in done.files:
        screen.print(f"  {path}")
    if done.exit_code == LOSS:
        screen.print(Message("exit code 5: tests failed or have losses; see the column error"))
    elif done.exit_code in EXIT_WORDS:
        screen.print(
            Message("exit code 130: interrupted; finished tests are kept, the same call does the rest")
        )
    return done.exit_code
