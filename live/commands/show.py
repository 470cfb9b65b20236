"""``phasedic show``: a finished run in the view, with a time slider, until a person ends it.

The view gets the curves and events first, then picture and maps time step by time step.
"""

from __future__ import annotations

import argparse
import math
import threading
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import zip_longest
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquire.errors import ConfigError, DataError, PhasedicError
from acquire.events import Level
from acquire.frame import Frame, frozen
from acquire.text import Amount, Message, about, counts, word
from analysis.evaluate import evaluate_test
from live.commands.options import add_gauge_option, add_gauges, add_time_span, whole
from live.commands.process import signals
from live.config.gauges import gauge_colours, outlines
from live.config.loading import from_dict
from live.config.new_files import check_free
from live.pipeline.consumer import Screen
from live.results.figures import figure_lines, tensile_options
from live.results.place_response import response_lines
from live.results.run_folder import RunFolder, open_run
from live.results.stored_response import FATE
from live.ui.rerun.messages import (
    STRAINS,
    ViewSetup,
    events_message,
    field_message,
    picture_message,
    rows_message,
)
from live.ui.rerun.view import View, spawn_viewer
from live.ui.rerun.wire import Kind, Parcel
from live.ui.terminal.screen import TerminalScreen
from live.words.language import told

MAX_BYTES = 500e6
"""Of pictures and maps as drawn: the viewer keeps them all in memory."""

_BYTES_PX, _BYTES_ZOI = 0.35, 250.0  # of a JPEG of speckle; of a ZOI in three maps, with its values
_MOST_READINGS = 200_000
_MAX_PX = 1280  # larger pictures are drawn reduced
_POLL_S, _CLOSE_S = 0.1, 600.0


@dataclass(frozen=True, slots=True)
class ShowRequest:
    """The part of a run that is shown.

    Attributes
    ----------
    start_s, end_s : float or None, s
        Since the start of the test.
    every : int or None
        One time step in so many; None: as many as the viewer can keep.
    """

    start_s: float | None = None
    end_s: float | None = None
    every: int | None = None


def show(
    run: RunFolder,
    request: ShowRequest,
    screen: Screen,
    stop: threading.Event,
    *,
    port: int,
    rrd: Path | None = None,
) -> None:
    """Show ``run`` until ``stop`` is set; with ``rrd`` into that file alone, until all is written.

    Raises
    ------
    ConfigError, DataError
        Nothing can be shown, a file cannot be read, or the view's process fails.
    """
    rows = selected_rows(run, request)
    _report_selection(len(rows), run, screen)
    played = _PlayedMessages(run, rows, screen)
    view = View(
        view_setup(run),
        port=None if rrd else port,
        rrd=rrd,
        notify=lambda text, level: None if stop.is_set() else _notify(screen, text, level),
        on_serving=lambda view: _announce(view, screen),
        playback=played.messages,
    )
    try:
        while not view.failed and not played.trouble and not (played.all if rrd else stop).wait(_POLL_S):
            if stop.is_set():
                break
    finally:
        view.close(_CLOSE_S if rrd and not stop.is_set() else 0.0)
    if played.trouble or view.failed:
        raise DataError(played.trouble or view.failed)


class _PlayedMessages:
    """The messages of a run, from the beginning for each process that is started.

    Attributes
    ----------
    all : Event
        Set once all were sent.
    trouble : str
        Why they ended early.
    """

    def __init__(self, run: RunFolder, rows: tuple[int, ...], screen: Screen) -> None:
        self._run, self._rows, self._screen = run, rows, screen
        self.all, self.trouble = threading.Event(), ""

    def messages(self) -> Iterator[Parcel]:
        try:
            done = 0
            for message in playback_messages(self._run, self._rows):
                yield message
                done += message.kind is Kind.FIELD
                self._screen.status(Message("instant {done} of {all}", *counts(done, len(self._rows))))
        except PhasedicError as error:
            self.trouble = str(error)
        self.all.set()


def _report_selection(shown: int, run: RunFolder, screen: Screen) -> None:
    if shown < run.strain.n:
        what = Message("{shown} of {n} instants", *counts(shown, run.strain.n))
        screen.print(Message("{what} are shown; --from, --to and --every choose others", what))
    if run.pictures is None and not run.notes:
        maps = Message("the pictures that were measured are not here any more; maps alone")
        screen.print(Message("note: {what}", maps))
    for note in run.notes:
        screen.print(Message("note: {what}", note))


def _notify(screen: Screen, text: str, level: Level) -> None:
    screen.print(text if level == "info" else about(word(level), text))


def _announce(view: View, screen: Screen) -> None:
    """Open the viewer where there is a display; else print how to watch."""
    if view.port is None:
        return
    if spawn_viewer(view.port, screen.print) is not None:
        screen.print(Message("the viewer opens in a window of its own; Ctrl-C here ends it"))
        return
    screen.print(Message("no viewer is opened here (no display); this shows it, Ctrl-C ends it:"))
    for line in view.instructions.splitlines():
        screen.print(f"  {line}")


def selected_rows(run: RunFolder, request: ShowRequest) -> tuple[int, ...]:
    """Rows of the time steps that are shown, always with the last.

    Raises
    ------
    ConfigError
        No time step is in the range.
    DataError
        The run has no time step.
    """
    rows = run.strain.rows_between(request.start_s, request.end_s, "--from, --to")
    every = request.every or math.ceil(len(rows) * _bytes_each(run) / MAX_BYTES)
    return rows[::-1][::every][::-1]


def _bytes_each(run: RunFolder) -> float:
    width, height = run.picture_size
    reduced = max(1, math.ceil(max(width, height) / _MAX_PX))
    return _BYTES_PX * width * height / reduced**2 + _BYTES_ZOI * run.strain.grid.n_active


def view_setup(run: RunFolder) -> ViewSetup:
    """Settings of the view for ``run``."""
    width, height = run.picture_size
    return ViewSetup(
        title=run.title,
        width=width,
        height=height,
        bits=run.pictures.info.bits if run.pictures is not None else 8,
        grid=run.strain.grid,
        start_monotonic=0.0,
        area_m2=run.specimen.area_m2,
        axis=run.load_axis.axis,
        finished=True,
        with_load=bool(np.isfinite(run.force).any()),
        outlines=_outlines(run),
        gauges=tuple(run.gauges),
        colours=gauge_colours(run.strain.config.get("gauges") or {}),
        whole=tuple(name for name in run.strain.whole_names if name not in (FATE, "instants")),
    )


def _outlines(run: RunFolder) -> dict[str, tuple[tuple[tuple[float, float], ...], ...]]:
    """Outlines of the gauges; none where the file does not have their positions."""
    described = {name: gauge.described for name, gauge in run.gauges.items()}
    try:
        gauges = from_dict({"gauges": described}, {}, str(run.path)).gauges
        return outlines(gauges, run.strain.grid.size)
    except ConfigError:
        return {}


def playback_messages(run: RunFolder, rows: tuple[int, ...]) -> Iterator[Parcel]:
    """All messages, with times in seconds since the start of the test.

    Raises
    ------
    DataError
        A file cannot be read.
    """
    yield Parcel(Kind.STATUS, {"markdown": _status(run)})
    if names := run.strain.whole_names:
        yield Parcel(Kind.WHOLE, {}, {name: run.strain.maps(name, 0) for name in names})
    yield from _curves(run)
    yield from _events(run)
    pictures = iter(()) if run.pictures is None else run.pictures.each(rows)
    since = 0
    for row, image in zip_longest(rows, pictures):
        t = float(run.strain.time_s[row])
        if image is not None and run.pictures is not None:
            yield picture_message(_frame(image, t, run.pictures.info.bits))
        yield rows_message(Kind.POINTS, _points(run, since, row + 1))
        since = row + 1
        yield field_message(t, run.field(row))


def _frame(image: NDArray[Any], t: float, bits: int) -> Frame:
    kind = np.uint8 if bits <= 8 else np.uint16
    levels = image if image.dtype == kind else np.rint(image).astype(kind)
    return Frame(frozen(levels), 0, t, "nominal", 0, bits, t)


def _curves(run: RunFolder) -> Iterator[Parcel]:
    values, t = run.strain.values, np.asarray(run.strain.time_s, np.float64)
    columns = [values[column] for name in STRAINS for column in (name, f"sigma_{name}")]
    yield rows_message(Kind.MEANS, zip(t, *columns, strict=True))
    for name, gauge in run.gauges.items():
        yield rows_message(Kind.GAUGE, zip(t, gauge.value, gauge.sigma, strict=True), name)
    shown = run.readings.thinned(_MOST_READINGS)
    times, forces = (shown.t, shown.values) if len(shown.t) else (t, run.force)
    known = np.isfinite(forces)
    yield rows_message(Kind.LOADS, zip(times[known].tolist(), forces[known].tolist(), strict=True))


def _points(run: RunFolder, start: int, stop: int) -> list[tuple[float, float]]:
    """Strain and N of some time steps, for the curve up to the time of the slider."""
    return list(zip(run.axial_strain[start:stop].tolist(), run.force[start:stop].tolist(), strict=True))


def _events(run: RunFolder) -> Iterator[Parcel]:
    yield events_message([replace(event, t=event.t - run.start_monotonic) for event in run.events])


def _status(run: RunFolder) -> str:
    """The figures of the test and the final values of the gauges, as Markdown."""
    figures = evaluate_test(run.curve, tensile_options(run.specimen))
    lines = figure_lines(figures, run.specimen, run.gauge_length)
    lines += [
        Message(
            "gauge **{name}** {strain} at the end", name, Amount("strain", gauge.value[-1], gauge.sigma[-1])
        )
        for name, gauge in run.gauges.items()
    ]
    lines += response_lines(run.strain)
    values = run.strain.values
    valid, zois = int(values["n_valid"][-1]), int(values["n_zoi"][-1])
    head = Message(
        "**{title}**, {n} instants, {valid} of {zois} ZOIs at the end",
        run.title,
        *counts(run.strain.n, valid, zois),
    )
    return "\n\n".join(told(line).strip() for line in (head, *lines))


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``phasedic show``."""
    parser.add_argument("run", help="folder of a run or replay, or a strain.h5")
    add_time_span(parser)
    words = "show one instant in N (default: as many as the memory of the viewer holds)"
    parser.add_argument("--every", type=whole(1), metavar="N", help=words)
    add_gauge_option(parser)
    words = "port of the view on 127.0.0.1 (default 9876)"
    parser.add_argument("--port", type=whole(1024, 65535), default=9876, help=words)
    words = "write this file instead of showing it, for: rerun FILE.rrd"
    parser.add_argument("--rrd", metavar="FILE.rrd", help=words)


def command(arguments: argparse.Namespace) -> int:
    """``phasedic show``."""
    screen, stop = TerminalScreen(), threading.Event()
    request = ShowRequest(arguments.start_s, arguments.end_s, arguments.every)
    rrd = Path(arguments.rrd) if arguments.rrd else None
    if rrd is not None:
        check_free(rrd)
    with signals(stop.set, None), open_run(arguments.run) as run:
        if arguments.more_gauges:
            add_gauges(run, Path(arguments.more_gauges))
        show(run, request, screen, stop, port=arguments.port, rrd=rrd)
    if rrd is not None:
        screen.print(str(rrd))
    return 0
