"""What the set-up shows, by value: force, colours, devices, drafts, region."""

from __future__ import annotations

import math
import os
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from acquire.camera import CameraListing
from acquire.errors import DataError
from acquire.frame import CameraInfo
from acquire.load_sample import LoadCellInfo, LoadSample
from acquire.serial_line.ports import PortInfo
from live.config.loading import load_config
from live.setup.check.lines import CheckLine
from live.ui.web.setup import config_draft, specimen_check
from live.ui.web.setup.config_draft import ConfigDraft, DeviceLists
from live.ui.web.setup.load_preview import LoadPreview
from live.ui.web.setup.specimen_check import (
    SpecimenCheck,
    figure_values,
    frame_stack,
    line_values,
    quality_colours,
    table_values,
)
from tests.live.made_up import CAMERA, make_frame, make_grid

INFO = CameraInfo("sim:", "sim", 256, 192, 12, True, "host")


def draft_of(folder: Path, text: str = "", **changes: Any) -> ConfigDraft:
    rig = folder / "rig.toml"
    rig.write_text(text)
    draft = ConfigDraft(load_config(rig, {}), rig, {})
    draft.change_all({key.replace("__", "."): value for key, value in changes.items()})
    return draft


# -- the load cell --------------------------------------------------------------------------------


def weighed(folder: Path, samples: list[LoadSample], now: float, **changes: Any) -> LoadPreview:
    draft, clock = draft_of(folder, load__address="sim:", **changes), [0.0]
    preview = LoadPreview(draft, lambda: clock[0])
    preview._samples.extend(samples)
    preview.info, preview._tried = LoadCellInfo("sim:", "a cell", "ascii"), "sim:"
    clock[0] = now
    return preview


def test_the_force_is_the_mean_of_half_a_second_less_the_zero(tmp_path: Path) -> None:
    """Rate and noise are of five seconds."""
    samples = [LoadSample(k / 10, 100.0 + (7.0 if k > 55 else 0.0)) for k in range(61)]
    samples[58] = LoadSample(5.8, math.nan)
    state = weighed(tmp_path, samples, 6.0, load__zero_N=20.0).state()
    assert state["force_N"] == pytest.approx((100 + 4 * 107) / 5 - 20)
    assert (state["zero_N"], state["name"], state["trouble"]) == (20.0, "a cell", "")
    assert state["rate"] == pytest.approx(49 / 5.0)  # one of 51 has no force
    assert weighed(tmp_path, samples[:1], 0.1).state()["rate"] is None
    assert weighed(tmp_path, [], 0.1).state()["force_N"] is None


def test_silence_is_a_fault_after_two_seconds(tmp_path: Path) -> None:
    for now, words in ((3.9, ""), (4.1, "the load cell is silent for 2 s"), (9.0, "silent for 7 s")):
        found = weighed(tmp_path, [LoadSample(2.0, 1.0)], now)
        assert words in found.trouble and bool(found.trouble) == bool(words)
        lines = [(line.what, line.good) for line in found.lines(found.report())]
        assert lines == ([("load cell", False)] if words else [])
    assert weighed(tmp_path, [], 2.1).trouble.startswith("the load cell is silent for 2 s"), (
        "since it was opened"
    )
    assert weighed(tmp_path, [], 1.9).trouble == ""


def test_a_still_force_is_tared_and_the_zero_restored(tmp_path: Path) -> None:
    found = weighed(tmp_path, [LoadSample(2 + k / 50, 40.0 + 0.1 * (k % 2)) for k in range(101)], 4.0)
    found.tare()
    assert found._draft.config.load.zero_N == pytest.approx(40.05, abs=0.01)
    assert found.state()["force_N"] == pytest.approx(0.0, abs=0.06)
    found.undo_tare()
    assert found._draft.config.load.zero_N == 0.0
    with pytest.raises(DataError, match="no tare to undo"):
        found.undo_tare()
    rising = weighed(tmp_path, [LoadSample(2 + k / 50, 10.0 * k) for k in range(101)], 4.0)
    with pytest.raises(DataError, match="the force is not still"):
        rising.tare()
    with pytest.raises(DataError, match="there is no force"):
        weighed(tmp_path, [LoadSample(2.0, 1.0)], 3.1).tare()


def test_another_load_cell_shows_no_force_of_the_one_before(tmp_path: Path) -> None:
    found = weighed(tmp_path, [LoadSample(2.0, 1.0)], 2.1)
    assert found.state()["force_N"] == 1.0
    found._draft.change_all({"load.address": "none:"})
    found._reopen.set()
    found._read()
    assert found.state()["force_N"] is None and found.state()["name"] == "" and found.report() is None


def test_samples_are_kept_for_five_seconds_and_end_a_fault(tmp_path: Path) -> None:
    found = weighed(tmp_path, [], 12.0)
    found._fault = "an old fault"
    found._take([LoadSample(t, 1.0) for t in (1.0, 5.0, 9.9)])  # type: ignore[arg-type]
    assert [s.t for s in found._samples] == [5.0, 9.9] and found.trouble == "an old fault"
    found._take([LoadSample(10.1, 1.0)])  # type: ignore[arg-type]
    assert [s.t for s in found._samples] == [9.9, 10.1]
    assert found.trouble == ""


# -- devices --------------------------------------------------------------------------------------


def drafted(folder: Path) -> Any:
    """A draft with this folder of results."""
    return SimpleNamespace(config=SimpleNamespace(output=SimpleNamespace(dir=str(folder))))


def test_the_devices_that_can_be_chosen(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for k in range(22):
        path = tmp_path / f"run{k:02}" / "session.h5"
        path.parent.mkdir()
        path.touch()
        os.utime(path, (1000 - k, 1000 - k))  # the first is the newest
    ports = [PortInfo("/dev/ttyUSB0", "a cell", "", True), PortInfo("/dev/ttyS1", "another", "", False)]
    lists = DeviceLists(
        drafted(tmp_path),
        lambda: [CameraListing("v4l2:/dev/video0", "a camera\x1b", "is busy")],
        lambda: ports,
    )
    lists._search()
    state = lists.state()
    addresses = [one["address"] for one in state["cameras"]]
    assert addresses[0] == "v4l2:/dev/video0" and addresses[-2:] == ["sim:", "sim:hole"]
    assert addresses[-3] == f"session:{tmp_path}/run00/session.h5" and len(addresses) == 1 + 20 + 2
    assert addresses[1] == f"session:{tmp_path}/run19/session.h5", "the newest twenty"
    assert state["cameras"][0]["trouble"] == "is busy" and "\x1b" not in state["cameras"][0]["name"]
    loads = state["loads"]
    assert [(one["address"], one["trouble"]) for one in loads[:2]] == [
        ("/dev/ttyUSB0", ""), ("/dev/ttyS1", "this user may not open it"),
    ]  # fmt: skip
    assert [one["address"] for one in loads[-2:]] == ["sim:", "none:"] and state["finding"] == ""
    finding = SimpleNamespace(address="/dev/ttyUSB0?baud=9600", protocol="ascii")
    monkeypatch.setattr(config_draft.identify, "listen", lambda port: iter([(0, 0, None), (0, 0, finding)]))
    for _ in range(2):
        lists._identify("/dev/ttyUSB0")
    assert lists.state()["loads"] == [{"address": finding.address, "name": "ascii"}, *loads]
    assert lists.state()["finding"] == "found: ascii; choose it in the list"
    monkeypatch.setattr(config_draft.identify, "listen", lambda port: iter([(0, 0, None)]))
    monkeypatch.setattr(config_draft.identify, "proposed", lambda line, received: None)
    lists._identify("/dev/ttyUSB0")
    assert lists.state()["finding"].startswith("nothing recognised")


def test_a_port_that_talks_and_is_not_understood_offers_a_pattern(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    lists = DeviceLists(drafted(tmp_path), cameras=list, ports=list)
    lines = b"".join(b"#%d;x=%.2f;ok\r\n" % (k % 7, 12.5 + k) for k in range(40))
    heard = [(9600, b"\x80\x13garbage", None), (19200, lines, None)]
    monkeypatch.setattr(config_draft.identify, "listen", lambda port: iter(heard))
    lists._identify("/dev/ttyUSB0")
    (offered,) = lists.state()["loads"]
    assert offered["name"] == "lines"
    assert (
        offered["address"].startswith("/dev/ttyUSB0?protocol=lines&baud=19200&")
        and "pattern=" in offered["address"]
    )
    found = lists.state()["finding"]
    assert "x=51.50" in found and "a pattern made from them is in the list" in found
    assert "is read as" in found


@pytest.mark.parametrize(
    ("error", "words"),
    [(DataError("no such port"), "no such port"), (ValueError("x"), "the search failed: ")],
)
def test_a_search_that_fails_says_why_and_another_may_begin(
    tmp_path: Path, error: Exception, words: str, caplog: pytest.LogCaptureFixture
) -> None:
    def failing() -> Any:
        raise error

    lists = DeviceLists(drafted(tmp_path), failing, list)
    for _ in range(2):
        assert lists._busy.acquire(blocking=False)
        lists._work(None)
        assert lists.state()["finding"].startswith(words)


# -- the check ------------------------------------------------------------------------------------


def figures(**more: Any) -> Any:
    grid = make_grid()
    sigma = np.full(grid.shape, 40e-6)
    sigma[1, 1], sigma[2, 2], sigma[3, 3] = math.sqrt(50e-6 * 1000e-6), 2e-3, math.nan
    noises = (SimpleNamespace(burst=8, known=30e-6), SimpleNamespace(burst=1, known=80e-6))
    floors = [
        SimpleNamespace(zoi=zoi, order=order, vsg=zoi, l10=2 * zoi, noises=found,
                        of=lambda n, found=found: next((one for one in found if one.burst == n), None))
        for zoi, order, found in ((32, 1, noises), (48, 1, noises[:1]), (32, 2, noises))
    ]  # fmt: skip
    return SimpleNamespace(
        zois=SimpleNamespace(sigma=sigma, grid=grid), floors=floors, order=1, zoi=32, burst=8, sharpness=0.25,
        exposure=SimpleNamespace(saturated=0.01, high=0.8), noise=2.5, **more,
    )  # fmt: skip


def test_the_noise_of_each_zoi_in_colours() -> None:
    """Green up to 50 um/m, red from 1000 um/m, yellow at their geometric mean; nothing outside the region."""
    cells = quality_colours(figures())
    assert cells[0, 0].tolist() == [0, 0, 0, 0]
    assert cells[0, 1].tolist() == [40, 170, 80, 110]
    assert np.abs(cells[1, 1].astype(int) - [240, 200, 30, 110]).max() <= 1
    assert cells[2, 2].tolist() == cells[3, 3].tolist() == [220, 50, 40, 110]


def test_the_figures_and_the_table_of_a_check() -> None:
    assert figure_values(figures()) == {
        "sharpness": 0.25, "saturated": 0.01, "light": 0.8, "noise_GL": 2.5, "sigma": pytest.approx(40e-6),
        "zois": 34,
    }  # fmt: skip
    assert table_values(figures()) == {
        "bursts": [1, 8],
        "rows": [
            {"zoi": 32, "order": 1, "vsg": 32, "l10": 64, "noise": [80e-6, 30e-6]},
            {"zoi": 48, "order": 1, "vsg": 48, "l10": 96, "noise": [None, 30e-6]},
        ],
        "zoi": 32, "burst": 8,
    }  # fmt: skip
    line = CheckLine("drift", "0.1 px\x1b", False, "wait\x07")
    shown = line_values(line)
    assert (shown["what"], shown["good"], shown["measured"]) == ("drift", False, True)
    assert "\x1b" not in shown["value"] and "\x07" not in shown["advice"]


def test_frames_that_were_lost_before_the_first_do_not_count() -> None:
    frames = [replace(make_frame(k, 10.0 + k), lost_before=lost) for k, lost in enumerate((5, 1, 0, 2))]
    stack = frame_stack(frames, CAMERA)
    assert stack.lost == 3 and stack.times.tolist() == [10, 11, 12, 13]


def test_the_peak_of_the_sharpness_is_held_until_it_is_reset(tmp_path: Path) -> None:
    check = SpecimenCheck(draft_of(tmp_path), None, None, None, tmp_path, lambda: None)  # type: ignore[arg-type]
    peaks = []
    for sharpness in (0.2, 0.5, math.nan, 0.3):
        check._keep_figures(SimpleNamespace(**vars(figures()) | {"sharpness": sharpness}))  # type: ignore[arg-type]
        peaks.append(check.values["peak"])
    check.reset_peak()
    check._keep_figures(figures())
    assert (peaks, check.values["peak"]) == ([0.2, 0.5, 0.5, 0.5], 0.25)


@pytest.mark.parametrize(
    ("width", "height", "burst", "frames"),
    [(256, 192, 30, 60), (5000, 4000, 30, 10), (20_000, 10_000, 30, 8), (256, 192, 3, 8)],
)
def test_a_whole_check_takes_two_bursts_of_the_reference_within_memory(
    tmp_path: Path, width: int, height: int, burst: int, frames: int
) -> None:
    draft = draft_of(tmp_path, f"[measure]\nreference_burst = {burst}\n")
    check = SpecimenCheck(draft, None, None, None, tmp_path, lambda: None)  # type: ignore[arg-type]
    assert check.frames_needed(replace(INFO, width=width, height=height)) == frames


class Region:
    """A region that is ready, or says why it is not."""

    edition, why, empty = 3, "", False
    drawn = object()

    def config(self, folder: Path) -> Any:
        return load_config(None, {})

    def ready(self, folder: Path) -> Any:
        if self.why:
            raise DataError(self.why)
        return SimpleNamespace(gauges={"axial": {}, "wide": {}} if not self.empty else {})


def checked(folder: Path, region: Any, load: Any = None) -> SpecimenCheck:
    preview: Any = SimpleNamespace(collect=lambda: None)
    return SpecimenCheck(draft_of(folder), preview, load, region, folder, lambda: None)


def test_a_gauge_beside_the_region_is_no_go(tmp_path: Path) -> None:
    region = Region()
    check = checked(tmp_path, region)
    line = check._gauge_line()
    assert (line.what, line.value, line.good) == ("gauges", "placed: axial, wide", True)
    region.empty = True
    assert check._gauge_line().value == "none: the strain of the region is reported"
    region.why = "gauge axial: no ZOI is there"
    line = check._gauge_line()
    assert (line.value, line.good, line.advice) == (region.why, False, "move it onto the region")


@pytest.mark.parametrize(("bad", "go"), [("", True), ("picture", False), ("load", False), ("gauges", False)])
def test_all_lines_of_a_check_must_be_good(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, bad: str, go: bool
) -> None:
    region = Region()
    region.why = "no ZOI is there" if bad == "gauges" else ""
    cell: Any = SimpleNamespace(
        report=lambda: "a report", lines=lambda found: [CheckLine("load cell", str(found), bad != "load")]
    )
    given: list[Any] = []
    monkeypatch.setattr(specimen_check, "examine", lambda *what: given.append(what) or figures())  # type: ignore[func-returns-value]
    monkeypatch.setattr(
        specimen_check, "check_lines", lambda *_: [CheckLine("picture", "a", bad != "picture")]
    )
    check = checked(tmp_path, region, cell)
    check.begin()
    assert check.values["checking"] and check.values["go"] is None
    check._check([make_frame(0, 1.0), make_frame(1, 2.0)], CAMERA)
    assert check.values["go"] is go and not check.values["checking"]
    assert [line["what"] for line in check.values["lines"]] == ["picture", "load cell", "gauges"]
    assert check.values["lines"][1]["value"] == "a report" == given[0][2]
    assert check.values["table"]["bursts"] == [1, 8] and check.values["noise_GL"] == 2.5
    check.discard()
    assert (check.values["go"], check.values["lines"], check.values["table"]) == (None, [], None)


def test_a_check_of_a_region_that_has_changed_gives_no_verdict(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    region = Region()

    def examined(*_: Any) -> Any:
        region.edition += 1
        return figures()

    monkeypatch.setattr(specimen_check, "examine", examined)
    monkeypatch.setattr(specimen_check, "check_lines", lambda *_: [])
    check = checked(tmp_path, region)
    check.begin()
    check._check([make_frame(0, 1.0)], CAMERA)
    assert check.values["go"] is None and check.values["lines"] == [] and check.values["sharpness"] == 0.25


def test_a_check_that_fails_is_no_go(tmp_path: Path) -> None:
    check = checked(tmp_path, Region())
    check._failed("no pattern")
    assert check.values["go"] is None and check.values["doubt"] == "no pattern", "none was asked for"
    check.begin()
    check._failed("no pattern")
    (line,) = check.values["lines"]
    assert check.values["go"] is False and not check.values["checking"]
    assert (line["what"], line["value"], line["good"]) == ("check", "no pattern", False)
