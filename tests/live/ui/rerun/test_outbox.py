"""What is sent to the process of the view, when, and in which order."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from acquire.events import Event, EventKind
from acquire.text.message import printable
from live.commands import show
from live.commands.show import ShowRequest, selected_rows, view_setup
from live.pipeline.snapshot import Snapshot
from live.results.run_folder import RunFolder, open_run
from live.results.stored_fields import Readings
from live.ui.rerun import view
from live.ui.rerun.messages import (
    ViewSetup,
    ViewTarget,
    events_of,
    figures_of,
    picture_message,
    rows_of,
    setup_of,
)
from live.ui.rerun.outbox import MAX_ROWS, Outbox, Pending
from live.ui.rerun.view import VIEWER_PACKAGES, View, remote_access, url, viewer_failure
from live.ui.rerun.wire import Kind, Parcel
from tests.live.made_run import CONFIG, GAUGES, PULLED, make_run
from tests.live.made_up import START, figures, make_field, make_frame, make_grid
from tests.live.screens import RecordingScreen

SETUP = ViewSetup("a test", 128, 96, 12, make_grid(), START, picture_hz=5.0)
TARGET = ViewTarget(None, "v.rrd", "id")
EVENT = Event(START, EventKind.NOTE, "operator", "a note")


def boxed(**more: Any) -> tuple[Outbox, Pending]:
    pending = Pending()
    return Outbox(SETUP, pending, **more), pending


def all_of(outbox: Outbox, now: float = 0.0) -> list[Parcel]:
    found = []
    while (message := outbox.next(now)) is not None:
        found.append(message)
    return found


def test_maps_of_the_whole_test_go_once_and_again_to_a_process_that_is_started_anew() -> None:
    outbox, pending = boxed()
    maps = {"compliance": np.full((5, 7), 14e-12), "sigma_compliance": np.full((5, 7), 1e-13)}
    pending.whole = maps
    (sent,) = all_of(outbox)
    assert sent.kind is Kind.WHOLE and not all_of(outbox)
    np.testing.assert_array_equal(sent.arrays["compliance"], maps["compliance"])
    outbox.begin(TARGET)
    assert [one.kind for one in all_of(outbox)].count(Kind.WHOLE) == 1


def test_small_things_go_first_and_each_once() -> None:
    outbox, pending = boxed()
    pending.picture, pending.field = make_frame(0, START), (START, make_field(make_grid(), 0.0))
    pending.figures, pending.status = Snapshot(START, "REC", figures=figures(force=7.0)), "**well**"
    pending.event(EVENT)
    pending.row(Kind.LOADS, (START, 5.0))
    pending.row(Kind.MEANS, (START, *[0.0] * 6))
    pending.row(Kind.LOADS, (START + 1, 6.0))
    found = all_of(outbox)
    assert [one.kind.name for one in found] == [
        "MEANS", "LOADS", "EVENTS", "STATUS", "FIGURES", "FIELD", "PICTURE",
    ]  # fmt: skip
    assert rows_of(found[1]) == [(START, 5.0), (START + 1, 6.0)] and events_of(found[2]) == [EVENT]
    assert found[3].meta["markdown"] == "**well**" and figures_of(found[4]).cells[2][1] == "7.0"
    assert all_of(outbox, 100.0) == [] and outbox.sent == {Kind.FIELD: 1, Kind.PICTURE: 1}


def test_fields_and_pictures_are_sent_at_their_rate() -> None:
    outbox, pending = boxed()
    counts = dict.fromkeys(Kind, 0)
    for k in range(1000):
        pending.field, pending.picture = (START, make_field(make_grid(), 0.0)), make_frame(0, START)
        for message in all_of(outbox, k / 100):
            counts[message.kind] += 1
    assert counts[Kind.FIELD] == pytest.approx(100, abs=2) and counts[Kind.PICTURE] == pytest.approx(
        50, abs=2
    )


def test_large_pictures_are_sent_less_often(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of 24,576 bytes, at most 60 kB/s: every 0.41 s."""
    monkeypatch.setattr("live.ui.rerun.outbox.MAX_BYTES_S", 60e3)
    outbox, pending = boxed()
    sent = 0
    for k in range(1000):
        pending.picture = make_frame(0, START)
        sent += len(all_of(outbox, k / 100))
    assert sent == pytest.approx(10 / (96 * 128 * 2 / 60e3), abs=1)


def test_a_new_process_gets_the_past() -> None:
    more = Parcel(Kind.STATUS, {"markdown": "played"})
    outbox, pending = boxed(playback=lambda: [more])
    outbox.begin(TARGET)
    assert " ".join(one.kind.name for one in all_of(outbox)) == "SETUP MEANS LOADS POINTS EVENTS STATUS"
    pending.row(Kind.POINTS, (1e-3, 5.0))
    pending.event(EVENT)
    pending.status = "**well**"
    all_of(outbox)
    outbox.begin(replace(TARGET, rrd="w.rrd"))
    setup, _, _, points, events, status, played = all_of(outbox)
    assert setup_of(setup)[1].rrd == "w.rrd"
    assert rows_of(points) == [(1e-3, 5.0)] and events_of(events) == [EVENT]
    assert status.meta["markdown"] == "**well**" and played is more


def test_the_end_comes_last_and_what_waits_at_once() -> None:
    outbox, pending = boxed()
    pending.field = (START, make_field(make_grid(), 0.0))
    all_of(outbox, 0.0)
    pending.field, pending.picture = (START, make_field(make_grid(), 0.0)), make_frame(0, START)
    outbox.next(0.0)
    pending.picture = make_frame(1, START)
    assert all_of(outbox, 0.0) == [], "not due yet"
    outbox.end()
    assert [one.kind.name for one in all_of(outbox, 0.0)] == ["FIELD", "PICTURE", "END"]
    assert outbox.next(9.0) is None, "once"


def test_what_nobody_takes_is_bounded_and_counted() -> None:
    pending = Pending()
    for k in range(1002):
        pending.event(replace(EVENT, t=float(k)))
    assert len(pending.events) == 1000 and pending.events[0].t == 2.0 and pending.dropped == 2
    for k in range(MAX_ROWS + 100):
        pending.row(Kind.LOADS, (float(k), 0.0))
    loads = pending.rows[Kind.LOADS]
    assert len(loads) == MAX_ROWS and loads[0][0] == 100.0 and pending.dropped == 102


def test_a_picture_is_thinned_to_its_limit() -> None:
    """In both directions: 2 x 2 of four times the limit."""
    side = 2000
    for height, step in ((side, 1), (side + 1, 2), (4 * side, 2), (4 * side + 8, 3)):
        assert picture_message(make_frame(0, START, (height, side))).meta["step"] == step


# -- the view -------------------------------------------------------------------------------------


class Started:
    """A supervisor that starts nothing."""

    failed, starts, pid = "", 3, 77

    def __init__(self, outbox: Outbox, target: ViewTarget, *_: Any) -> None:
        self.target, self.served = target, SimpleNamespace(port=9877, rrd="/a/v.rrd")

    def start(self) -> None: ...


@pytest.fixture
def shown(monkeypatch: pytest.MonkeyPatch) -> View:
    monkeypatch.setattr(view, "Supervisor", Started)
    return View(SETUP, port=9876, rrd=Path("v.rrd"))


def test_a_fast_test_is_thinned_for_the_view(shown: View) -> None:
    """50 load samples a second, 5 pictures a second."""
    pictures = 0
    for k in range(1000):
        t = START + k / 200
        shown.load(t, float(k))
        shown.load(t, math.nan)
        before = shown._pending.picture
        shown.picture(make_frame(k, t, (2, 2)))
        pictures += shown._pending.picture is not before
    loads = list(shown._pending.rows[Kind.LOADS])
    assert len(loads) == 250 and loads[:2] == [(START, 0.0), (START + 0.02, 4.0)] and pictures == 25
    shown.point(1e-3, 7.0)
    assert list(shown._pending.rows[Kind.POINTS]) == [(1e-3, 7.0)]


def test_the_view_tells_what_it_drew_and_how_to_watch(shown: View, monkeypatch: pytest.MonkeyPatch) -> None:
    shown._outbox.sent.update({Kind.FIELD: 7, Kind.PICTURE: 5})
    shown._pending.dropped = 2
    assert shown.report == (
        "7 maps and 5 pictures drawn, 2 rows or events dropped, its process was started 3 times"
    )
    assert (shown.port, shown.rrd, shown.pid) == (9877, Path("/a/v.rrd"), 77)
    monkeypatch.setattr(view, "rerun_command", lambda: "rerun")
    for display, count in ((True, 2), (False, 3)):
        monkeypatch.setattr(view, "has_display", lambda display=display: display)
        lines = shown.instructions.splitlines()
        assert len(lines) == count and lines[0] == f"watch: rerun --connect {url(9877)}"
        assert lines[-1] == "later: rerun /a/v.rrd"
    assert url(9877) == "rerun+http://127.0.0.1:9877/proxy"
    assert remote_access(9877).startswith("ssh -N -L 9877:127.0.0.1:9877 ")
    supervised: Any = shown._supervisor
    assert supervised.target.port == 9876 and Path(supervised.target.rrd) == Path("v.rrd").absolute()


def test_why_a_viewer_did_not_open() -> None:
    words = "\x1b[31mlog\x1b[0m\nError: winit os error at src/x.rs:3 no display\n"
    assert viewer_failure(words).startswith("the viewer did not open (winit no display); ")
    assert "(no reason given)" in viewer_failure("nothing") and VIEWER_PACKAGES in viewer_failure("")


# -- a finished run -------------------------------------------------------------------------------


def test_the_settings_and_the_words_of_a_finished_run(tmp_path: Path) -> None:
    with open_run(make_run(tmp_path, config={**CONFIG, "gauges": GAUGES})) as run:
        setup = view_setup(run)
        assert (setup.title, setup.width, setup.height, setup.bits) == ("S1", 128, 96, 12)
        assert (setup.start_monotonic, setup.axis, setup.finished) == (0.0, "y", True)
        assert setup.area_m2 == pytest.approx(20e-6)
        means, *_, loads = show._curves(run)
        assert rows_of(means)[3][3:5] == (run.strain.values["eyy"][3], run.strain.values["sigma_eyy"][3])
        assert [row[0] for row in rows_of(loads)][:3] == pytest.approx([0.0, 0.1, 0.2], abs=1e-9)
        run.__dict__["readings"] = Readings(lambda: iter(()))
        run.strain.values["force_N"][1] = np.nan
        *_, loads = show._curves(run)
        assert [row[0] for row in rows_of(loads)][:2] == pytest.approx([0.0, 0.2])
        run.__dict__["pictures"] = None
        plain = view_setup(run)
        assert (plain.width, plain.height, plain.bits) == (128, 96, 8)


def test_as_many_instants_as_the_viewer_keeps(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with open_run(make_run(tmp_path, PULLED[:20], session=False)) as run:
        monkeypatch.setattr(RunFolder, "picture_size", (3000, 1000))
        # A third of the sides is drawn, 0.35 byte a pixel, and 250 bytes a ZOI.
        each = 0.35 * 3000 * 1000 / 9 + 250 * 34
        for limit, every in ((20 * each, 1), (19.9 * each, 2), (10 * each, 2), (9.9 * each, 3)):
            monkeypatch.setattr(show, "MAX_BYTES", limit)
            assert selected_rows(run, ShowRequest()) == tuple(range(19, -1, -every))[::-1]


def test_means_have_levels_of_the_camera() -> None:
    for bits, kind in ((8, np.uint8), (12, np.uint16)):
        frame = show._frame(np.array([[1.4, 1.6]]), 2.5, bits)
        assert (
            frame.image.dtype == kind
            and frame.image.tolist() == [[1, 2]]
            and (frame.t, frame.bits) == (2.5, bits)
        )


def test_what_is_missing_is_told() -> None:
    screen = RecordingScreen()
    run: Any = SimpleNamespace(strain=SimpleNamespace(n=5), pictures=None, notes=())
    show._report_selection(5, run, screen)
    run.notes = ("why",)
    show._report_selection(4, run, screen)
    show._notify(screen, "a word", "info")
    show._notify(screen, "a word", "warning")
    first, second, third, *told = screen.lines
    assert first.endswith("are not here any more; maps alone") and second.startswith(
        "4 of 5 instants are shown"
    )
    assert third == "note: why" and told == ["a word", "warning: a word"] and printable(first) == first
