"""The status line of several cameras, the bell, and what a summary tells beyond its figures."""

from __future__ import annotations

import io
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from acquire.events import EventKind
from analysis.evaluate import GaugeValue
from live.config.sections import SpecimenConfig
from live.pipeline.consumer import ConsumerReport
from live.pipeline.run_state import FrameCounts, RunState
from live.pipeline.snapshot import Snapshot
from live.results.summary import StatusCard, file_lines
from live.ui.terminal.screen import (
    CamerasScreen,
    TerminalScreen,
    cameras_line,
    fitted,
    gauge_texts,
    status_line,
    strain_text,
)
from live.ui.terminal.summary import print_summary, trouble_lines
from tests.live.made_run import finished
from tests.live.made_up import START, figures, in_ascii, make_loads, make_measurement
from tests.live.screens import RecordingScreen, Terminal
from tests.live.ui.terminal.test_screen import time_step


class Said(RecordingScreen):
    """Keeps the status lines among the lines."""

    width, is_due = 200, True  # type: ignore[assignment]

    def status(self, text: str) -> None:
        self.lines.append(f"status: {text}")


def shot(valid: int = 30, **more: Any) -> Snapshot:
    counts = FrameCounts()
    counts.add(grabbed=80, measured=9, skipped=2, **more.pop("counts", {}))
    known = {"force": 1234.5, "axial": (1e-3, 1e-6), "burst": 1.0, "fps": 10.0} | more.pop("figures", {})
    values: dict[str, Any] = {"valid": valid, "zois": 34, "time_step": time_step(), "frames": counts.as_dict(),
                              "figures": figures(**known)}  # fmt: skip
    return Snapshot(START, "REC", 75.0, **(values | more))


def test_mean_and_bending_and_what_each_camera_does() -> None:
    sides = {"front": shot(), "back": shot(29, counts={"lost": 3})}
    both = {"axial": (2e-3, -1e-4, 2e-6), "wide": (5e-3, 3e-4, 2e-5)}
    assert in_ascii(cameras_line(sides, both, 220, "waits")) == (
        "REC  1:15  1234.5 N  waits  axial 2000 +- 2 um/m, bending -100 +- 2 um/m  wide 5000 +- 20 um/m, "
        "bending 300 +- 20 um/m  front 30/34 ZOIs  SKIPPED 2  lost 0  back 29/34 ZOIs  SKIPPED 2  LOST 3"
    )
    short = in_ascii(cameras_line(sides, both, 110))
    assert "axial 2000" in short and "wide" not in short and "LOST 3" in short


def test_each_camera_by_itself_where_there_is_no_mean() -> None:
    sides = {"first": shot(), "second": shot(figures={"axial": math.nan}),
             "third": shot(figures={"axial": (-2e-3, 1e-6)}, time_step=None)}  # fmt: skip
    line = in_ascii(cameras_line(sides, {}, 300))
    assert "first 1000 +- 1 um/m" in line and "third -2000 +- 1 um/m" in line and "second - (" in line
    assert "third 80 frames" in line and "second 30/34 ZOIs" in line


def test_lines_of_a_side_have_its_name() -> None:
    screen = Said()
    both = CamerasScreen(screen)
    front = both.of("front")
    front.print("a word")
    front.print()
    front.status("waits")
    front.bell()
    assert screen.lines == ["front: a word", "", "status: front: waits"] and screen.rung == 1 and front.is_due


@pytest.mark.parametrize("names", [("front", "back"), ("first", "second")])
def test_the_line_has_the_mean_of_front_and_back(names: tuple[str, str]) -> None:
    states = {name: RunState.new(1.0, specimen=SpecimenConfig(axis="y")) for name in names}
    for state, strain in zip(states.values(), (1.2e-3, 0.8e-3), strict=True):
        state.health.began_t = START - 5
        for number in range(3):
            state.history.add(make_measurement(number, strain).time_step)
    screen = Said()
    both = CamerasScreen(screen)
    both.of(names[0]).snapshot(shot(), "waits")
    assert f"{names[0]} 30/34 ZOIs" in screen.lines[-1] and names[1] not in screen.lines[-1]
    both.attach(states)
    both.of(names[1]).snapshot(shot(), "waits")
    line = in_ascii(screen.lines[-1])
    assert f"{names[0]} 33/34 ZOIs" in line and f"{names[1]} 33/34 ZOIs" in line
    if names[0] == "front":
        assert "axial 1000.0 +- " in line and "bending 200.0 +- " in line
    else:
        assert "first 1200.0 +- " in line and "second 800.00 +- " in line and "bending" not in line


def test_the_items_of_least_rank_go_first() -> None:
    items = [(1, "alarm"), (9, "late"), (5, "strain"), (9, "later"), (2, "")]
    assert fitted(items, 99) == "alarm  late  strain  later"
    assert fitted(items, 21) == "alarm  strain  later" and fitted(items, 13) == "alarm  strain"
    assert fitted(items, 12) == "alarm" and fitted(items, 3) == "ala" and fitted(items, -1) == ""


def test_strains_in_words() -> None:
    assert strain_text(-1.2345e-3, 4e-6) == "−1\u202f235 ± 4 µm/m"
    step = make_measurement(0).time_step
    gauges = {name: GaugeValue(1e-3, 1e-6) for name in "abcde"} | {
        "b": GaugeValue(math.nan, math.nan, "lost")
    }
    texts = gauge_texts(replace(step, gauges=gauges | {"c": GaugeValue(1e-3, 1e-6, share=0.5)}))
    assert list(map(in_ascii, texts)) == [
        "a 1000 +- 1 um/m", "b lost", "c 1000 +- 1 um/m of 50 % of the area", "d 1000 +- 1 um/m"
    ]  # fmt: skip


def test_the_line_of_a_live_run_by_its_state() -> None:
    line = status_line(
        shot(axis="x", axis_assumed=True, figures={"fps": 29.6}, counts={"unrecorded": 2}), 300
    )
    assert "axis x assumed" in line and "frames/s 30" in line and "LOST 2" in line and "disk" not in line
    early = status_line(shot(time_step=None, axis_assumed=True, alarms=("a", "b")), 300)
    assert early.startswith("ALARM a ALARM b  REC") and "80 frames" in early and "assumed" not in early


def test_the_bell_is_for_terminals() -> None:
    for stream, quiet, rung in (
        (Terminal(), False, "\a"),
        (Terminal(), True, ""),
        (io.StringIO(), False, ""),
    ):
        TerminalScreen(stream, quiet=quiet).bell()
        assert stream.getvalue() == rung


def test_what_was_lost_is_told_after_the_counts() -> None:
    state = RunState.new(1.0)
    reports = [
        ConsumerReport("well", summary="all drawn"),
        ConsumerReport("results", failed="a full disk"),
        ConsumerReport("view", dropped={"measurement": 3}),
    ]
    brief, whole = ([*trouble_lines(state, reports, verbose=verbose)] for verbose in (False, True))
    assert len(brief) == 3 and len(whole) == 4 and brief[0] == whole[0] == state.frame_counts.line()
    assert "a full disk" in brief[1] and brief[2].startswith("  view")
    for level in ("warning", "warning", "error"):
        state.event_log.emit(EventKind.DEVICE, "camera", f"a {level}", level)  # type: ignore[arg-type]
    assert [*trouble_lines(state, ())][-1] == "2 warnings and 1 error, the last: camera: a error"


def test_where_the_files_are(tmp_path: Path) -> None:
    (tmp_path / "a.h5").write_bytes(bytes(12_340_000))
    (tmp_path / "empty.h5").touch()
    screen = Said()
    state = RunState.new(1.0)
    print_summary(screen, state, finished(state), tmp_path, ["a line"], with_report=True)
    assert screen.lines[0] == "" and screen.lines[-2:] == ["a line", f"files: {tmp_path} (a.h5; 12.3 MB)"]
    assert file_lines(tmp_path) == [f"  {tmp_path / 'a.h5'}  (12.3 MB)"]


def test_the_card_of_the_view() -> None:
    state = RunState.new(1.0, specimen=SpecimenConfig())
    card = StatusCard(SpecimenConfig(), make_loads(1.0, lambda t: t))
    assert [card.is_due(t) for t in (0.0, 0.9, 1.0, 1.5, 2.0)] == [True, False, True, False, True]
    step = replace(make_measurement(1).time_step, zoi_sigma=30e-6, sigma_eyy=4.2e-6, area_share=0.5)
    state.history.add(step)
    text = card.written(shot(axis="x", axis_assumed=True, counts={"recorded": 7, "lost": 1}), state.history)
    assert "**33 of 34** ZOIs valid" in text and "one ZOI **30 µm/m**, region **4.2 µm/m** (1 σ)" in text
    assert "strain **of 50 % of the area**" in text and "axis of the load **x**, assumed" in text
    assert text.endswith("recorded 7, measured 9, skipped 2, lost **1**")
