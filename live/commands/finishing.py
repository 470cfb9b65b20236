"""The end of a test, measured live or replayed: summaries, front and back put together, report, exit code."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from acquire.errors import EXIT_WORDS, LOSS, PhasedicError
from acquire.text import Message
from live.commands.sides import TABLE, put_together
from live.config.cameras import BACK, FRONT
from live.pipeline.consumer import Screen
from live.results.finished.figures_file import FILE
from live.ui.terminal.screen import CamerasScreen
from live.ui.terminal.summary import print_summary

if TYPE_CHECKING:
    from live.replay.replay import Replayed
    from live.run.outcome import Outcome


def finish_test(
    cameras: Mapping[str, Outcome | Replayed],
    lines: Mapping[str, Sequence[str]],
    folder: Path,
    code: int,
    screen: Screen,
    *,
    verbose: bool = False,
) -> int:
    """Print the summary of each camera with its ``lines``, and what is of all; the exit code, which was ``code``.

    A report is made where that is configured: one, of all cameras. Figures or a report that could not be written are a
    loss.
    """
    every, several = CamerasScreen(screen), len(cameras) > 1
    report = next(iter(cameras.values())).config.output.report
    for name, one in cameras.items():
        own, alone = every.of(name), report and not several
        print_summary(
            own, one.run_state, one.test, one.folder, lines[name], verbose=verbose, with_report=alone
        )
        if not (one.folder / FILE).exists():
            code = code or LOSS
    if several:
        screen.print()
    if FRONT in cameras:
        try:
            put_together(folder / FRONT, folder / BACK, folder / TABLE, screen)
        except PhasedicError as error:
            screen.print(Message("warning: front and back were not put together: {why}", error))
            code = code or LOSS
    if report:
        from live.commands.report import write_report

        if write_report(folder, screen):
            code = code or LOSS
    if code in EXIT_WORDS:
        screen.print(Message("exit code {code}: {words}", code, EXIT_WORDS[code]))
    return code
