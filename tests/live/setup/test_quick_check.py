"""The repeated check: it holds the peak of the sharpness, and Ctrl-C prints the full table."""

from __future__ import annotations

import importlib
import math
import os
import signal
import threading
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from acquire.errors import DeviceError
from analysis.field import Blur
from live.cli import main
from live.commands import check as check_watch
from live.commands.check import blur_line, card, peak_line
from live.config.loading import load_config
from live.setup.check.check_list import examine
from live.setup.check.lines import CheckLine
from live.setup.check.quick_check import (
    RENEW_EVERY,
    SEARCH_EVERY,
    QuickCheck,
    QuickChecker,
    RollingFrames,
    _same_region,
)
from live.setup.check.sample import take
from live.setup.region import Region
from tests.live.fakes import ListCamera, frame

STILL = "sim:uniform?bits=8&fps=50&width=224&height=192"
SMALL = ["--zoi", "48", "--reference-burst", "8"]
QUICK = {
    "camera.address": STILL + "&seconds=5&lockstep=yes", "measure.zoi": 48, "measure.reference_burst": 8,
}  # fmt: skip


def test_the_peak_is_held() -> None:
    config = load_config(None, QUICK)
    sharp, checker, found = take(config), QuickChecker(config), []
    for blur in (2.0, 1.0, 0.0, 1.5):
        frames = np.stack([gaussian_filter(f.astype(np.float32), blur) for f in sharp.frames[:8]])
        quick = checker.check(replace(sharp, frames=np.round(frames).astype(np.uint8), times=sharp.times[:8]))
        found.append(quick)
    values = [quick.figures.sharpness for quick in found]
    assert values[0] < values[1] < values[2] > values[3]
    assert [quick.of_peak for quick in found[:3]] == [1.0, 1.0, 1.0]
    assert found[3].peak == values[2]
    assert f"{values[3] / values[2]:.0%} of the peak" in peak_line(found[3])
    assert peak_line(found[3]).count("#") == round(30 * values[3] / values[2])
    assert found[0].figures.floors == ()
    # Of each against the sharpest before: the second is sharper by more than can be measured, and takes its place.
    assert abs(found[0].blur.px) < 0.01 and math.isnan(found[1].blur.px) and found[2].blur.px < 0
    assert found[3].blur.px == pytest.approx(1.5, rel=0.35)
    assert "less sharp by" in blur_line(found[3])[0] and blur_line(found[3])[0] in card(found[3], [])


class FakeView:
    """Collects its pictures and cards."""

    made: list[FakeView]

    def __init__(self, setup: Any, **how: Any) -> None:
        self.cards, self.pictures, self.closed = [], [], False
        FakeView.made.append(self)

    def picture(self, frame: Any) -> None:
        self.pictures.append(frame)

    def status(self, text: str) -> None:
        self.cards.append(text)

    def close(self, seconds: float) -> None:
        self.closed = True


@pytest.mark.slow
def test_ctrl_c_leaves_the_table(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    FakeView.made = []
    monkeypatch.setattr(check_watch, "View", FakeView)
    checks = []

    def counted_peak_line(quick: Any) -> str:
        checks.append(quick)
        if len(checks) == 3:
            threading.Thread(target=os.kill, args=(os.getpid(), signal.SIGINT)).start()
        return peak_line(quick)

    monkeypatch.setattr(check_watch, "peak_line", counted_peak_line)
    before = signal.getsignal(signal.SIGINT)
    camera = STILL + "&seconds=10000&hold=9000&lockstep=yes"
    assert main(["check", "--watch", "--camera", camera, *SMALL]) == 0
    assert signal.getsignal(signal.SIGINT) is before
    output = capsys.readouterr().out
    assert "sharpness 0." in output
    assert "\n*  48     1       105      33" in output
    assert output.rstrip().endswith("GO: ready")
    (view,) = FakeView.made
    assert view.closed
    assert view.pictures
    assert "| light |" in view.cards[0]


def test_a_camera_that_ends(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("live.setup.pictures.at_rest", lambda address: address)
    arguments = ["--camera", STILL + "&seconds=4&lockstep=yes", "--no-view", *SMALL]
    assert main(["check", "--watch", *arguments]) == 0
    assert "strain noise of one ZOI" in capsys.readouterr().out
    short = ["--camera", STILL + "&seconds=0.1", "--no-view", *SMALL]
    assert main(["check", "--watch", *short]) == 4
    assert "whole frames, a check needs 8" in capsys.readouterr().err


def test_the_work_of_a_quick_check(monkeypatch: pytest.MonkeyPatch) -> None:
    """Slow figures take turns, the picture is averaged once; the figures are those of a check."""
    config = load_config(None, QUICK)
    sixteen = take(config)
    stack = replace(sixteen, frames=sixteen.frames[:8], times=sixteen.times[:8])
    done: list[str] = []

    def counted(module: str, name: str, what: str) -> None:
        real = getattr(importlib.import_module(module), name)

        def call(*arguments: Any, **more: Any) -> Any:
            done.append(what)
            return real(*arguments, **more)

        monkeypatch.setattr(f"{module}.{name}", call)

    counted("live.setup.check.noise_floor", "prepare", "reference")
    counted("live.setup.check.stillness", "prepare", "reference")
    counted("live.setup.check.quick_check", "find_region", "search")
    counted("live.setup.check.check_list", "noise_floors", "table")
    checker, work, checks = QuickChecker(config), list[list[str]](), list[QuickCheck]()
    for _ in range(2 * SEARCH_EVERY):
        checks.append(checker.check(stack))
        work.append(list(done))
        done.clear()
    assert work[0] == ["search", "reference", "reference"]
    assert all(len(one) <= 1 for one in work[1:])
    later = [what for one in work[SEARCH_EVERY:] for what in one]
    assert (later.count("reference"), later.count("search")) == (2 * SEARCH_EVERY // RENEW_EVERY, 1)
    once, last = examine(stack, config, table=False), checks[-1].figures
    assert (last.noise, last.exposure, last.radius, last.still, last.gauges) == (
        once.noise, once.exposure, once.radius, once.still, once.gauges,
    )  # fmt: skip
    for name in ("sigma", "contrast", "sssig", "sharpness"):
        np.testing.assert_array_equal(getattr(last.zois, name), getattr(once.zois, name))


def test_the_region_stays_where_only_its_rim_is_found_otherwise(monkeypatch: pytest.MonkeyPatch) -> None:
    config = load_config(None, {"camera.address": STILL + "&seconds=5&lockstep=yes", "measure.zoi": 48})
    stack = take(config)
    boxes = iter([(8, 8, 200, 176), (9, 8, 199, 176), (60, 8, 148, 176)])
    monkeypatch.setattr(
        "live.setup.check.quick_check.find_region", lambda *_: Region(next(boxes), None, "found", True)
    )
    monkeypatch.setattr("live.setup.check.quick_check.SEARCH_EVERY", 1)
    checker = QuickChecker(config)
    assert [checker.check(stack).figures.region.box for _ in range(3)] == [
        (8, 8, 200, 176),
        (8, 8, 200, 176),
        (60, 8, 148, 176),
    ]


def test_pictures_that_are_few_leave_their_table(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    config = load_config(None, {"camera.address": STILL + "&seconds=5&lockstep=yes"})
    cv2.imwrite(str(tmp_path / "one.png"), take(config).frames[0])
    assert main(["check", "--watch", "--camera", f"files:{tmp_path}", "--no-view", *SMALL]) == 0
    assert "GO, as far as 1 picture can show" in capsys.readouterr().out


def test_the_card_is_a_table() -> None:
    quick: Any = type("G", (), {"of_peak": math.nan, "blur": Blur(math.nan, math.nan)})()
    text = card(quick, [CheckLine("a|b", "1"), CheckLine("c", "2", False)])
    assert "| a/b | 1 |" in text
    assert "| **LOOK** | c | 2 |" in text


def test_the_newest_frames_of_a_camera_without_damaged_ones() -> None:
    shown = [frame(k, damaged=k == 18, lost=2 if k in (3, 12) else 0) for k in range(20)]
    frames = RollingFrames(ListCamera(shown, live=True), 10, "list:")  # type: ignore[arg-type]
    assert frames.frame() is None
    with frames:
        frames._thread.join()
        assert frames.over and frames.received == 19
        newest = frames.frame()
        assert newest is not None and newest.index == 19
        stack = frames.newest(8)
        assert stack is not None and stack.times.tolist() == pytest.approx(
            [1.1, 1.2, 1.3, 1.4, 1.5, 1.6, 1.7, 1.9]
        )
        assert stack.lost == 2, "between those that are looked at"
        seven = frames.newest(7)
        assert seven is None
    short = RollingFrames(ListCamera(shown[:4], error=DeviceError("gone")), 1, "list:")  # type: ignore[arg-type]
    with short:
        short._thread.join()
        with pytest.raises(DeviceError, match="gone"):
            short.newest(8)


@pytest.mark.parametrize(("width", "same"), [(100, True), (98, True), (97, False)])
def test_a_region_is_the_same_up_to_two_hundredths(width: int, same: bool) -> None:
    where: Any = SimpleNamespace(
        camera=SimpleNamespace(width=200, height=100), config=load_config(None, {"measure.zoi": 32})
    )
    one, other = Region((0, 0, 100, 50), None, "", True), Region((0, 0, width, 50), None, "", True)
    assert _same_region(one, other, where) == same == _same_region(other, one, where)
    assert not _same_region(one, replace(one, found=False), where)
