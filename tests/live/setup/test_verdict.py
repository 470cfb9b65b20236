"""A check: the words for given figures, the budget of E, the room on the disk, and the colours of its drawing."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from acquire.frame import CameraInfo
from analysis.quality.steadiness import Steadiness
from live.config.loading import load_config
from live.results.budget import CameraView, budget_rows
from live.setup.check import lines as check_line
from live.setup.check.check_list import automatic_controls, table_lines
from live.setup.check.lines import CheckLine, _vibration, budget_lines, disk_lines, reaching, write_rate
from live.setup.check.noise_floor import GaugeNoise, StrainNoise, ZoiFloor
from live.setup.check.sample import FrameStack
from live.setup.check.stillness import PictureStillness
from live.setup.check.verdict import _flicker, _sharpness
from live.setup.region import Region
from live.setup.specimen_drawing import FAIR, GOOD, POOR, Overlay, _Drawing
from tests.live.made_up import make_grid


def sides(left: float, right: float, top: float, bottom: float) -> CheckLine:
    """A sharpness of four quarters that are the sums of their sides."""
    values = np.add.outer(np.repeat([top, bottom], 4), np.repeat([left, right], 5))
    figures: Any = SimpleNamespace(zois=SimpleNamespace(sharpness=values), sharpness=0.25)
    return _sharpness(figures)


@pytest.mark.parametrize(
    ("given", "words", "good"),
    [
        ((0.1, 0.3, 0.1, 0.1), "0.250 1/px, left 0.200, right 0.400", False),
        ((0.3, 0.1, 0.1, 0.1), "0.250 1/px, right 0.200, left 0.400", False),
        ((0.1, 0.1, 0.1, 0.3), "0.250 1/px, top 0.200, bottom 0.400", False),
        ((0.10, 0.14, 0.1, 0.1), "0.250 1/px, left 0.200, right 0.240", True),
        ((0.1, 0.187, 0.1, 0.1), "0.250 1/px, left 0.200, right 0.287", False),
        ((0.1, 0.185, 0.1, 0.1), "0.250 1/px, left 0.200, right 0.285", True),
    ],
)
def test_the_softest_and_the_sharpest_side_are_named(
    given: tuple[float, ...], words: str, good: bool
) -> None:
    line = sides(*given)
    assert (line.value, line.good) == (words, good)
    assert line.advice.startswith(f"softer at the {words.split()[2]}:")


@pytest.mark.parametrize(
    ("drift", "other", "shown"), [(1.4, 1.4, 0.0), (1.6, 1.6, 1.6), (-1.6, -1.6, -1.6), (1.6, -1.6, 0.0)]
)
def test_the_distance_changes_where_both_strains_drift_alike_beyond_one_and_a_half_times_the_noise(
    drift: float, other: float, shown: float
) -> None:
    still, noisy = Steadiness(0.0, 0.0, 0.0, None, 2.0, 30.0), Steadiness(drift, 1.0, 1.0, None, 2.0, 30.0)
    quieter = replace(noisy, drift=other, noise=0.1)
    found = PictureStillness(still, still, noisy, quieter, ((still, still), (still, still)), still)
    assert found.dilatation == shown, "of the noisier of both"


def flicker(rms: float, drift: float, frequency: float | None, rate: float) -> CheckLine:
    figures: Any = SimpleNamespace(
        still=SimpleNamespace(light=Steadiness(drift, rms, 0.0, frequency, 2.0, rate))
    )
    return _flicker(figures)


def test_flicker_has_its_mains_and_the_exposure_of_whole_periods_of_the_light() -> None:
    line = flicker(0.02, 0.0, 10.0, 30.0)
    assert "lamps on 50 Hz mains (100 Hz, seen at 10.0 Hz)" in line.value and not line.good
    assert line.advice == "a lamp on direct current, or an exposure of a multiple of 10.0 ms"
    line = flicker(0.02, 0.0, 5.0, 25.0)
    assert "mainly" not in line.value and "60 Hz mains (120 Hz, seen at 5.0 Hz)" in line.value
    assert "multiple of 8.3 ms" in line.advice
    assert "at 25 fps that of 50 Hz mains stands still" in line.value
    assert flicker(0.0099, -0.01, None, 31.0).good and not flicker(0.0, -0.0101, None, 31.0).good


def test_a_vibration_has_its_upper_limit_where_it_is_noise() -> None:
    def words(rms: float, noise: float, frequency: float | None = None) -> str:
        return _vibration(Steadiness(0.0, rms, noise, frequency, 2.0, 120.0), 1e6, "µm/m", 0)

    assert words(5e-6, 5e-6) == "less than 5 µm/m"
    assert words(13e-6, 5e-6) == "12 µm/m rms"
    assert words(13e-6, 5e-6, 50.0) == "12 µm/m rms, mainly at 50.0 Hz, as from 50 Hz mains"
    assert words(13e-6, 5e-6, 20.0) == "12 µm/m rms, mainly at 20.0 Hz"


def test_automatic_controls_are_told_by_name_and_value() -> None:
    controls: dict[str, Any] = {
        "auto_exposure": "Manual Mode", "exposure_auto": "Aperture Priority Mode", "auto_2": "Shutter Priority",
        "gain_automatic": 1, "white_balance_automatic": 0, "focus_automatic_continuous": True, "gain": 1,
        "exposure_dynamic_framerate": 1, "power_line": "Auto", "automatic_3": "disabled", "automatic_4": "Off",
    }  # fmt: skip
    assert automatic_controls(controls) == (
        "exposure_auto", "gain_automatic", "focus_automatic_continuous", "exposure_dynamic_framerate",
    )  # fmt: skip


FLOORS = tuple(
    ZoiFloor(
        zoi, order, 2.0 * zoi, 0.5 * zoi, 9, tuple(StrainNoise(n, k / n, k / n * 1.1) for n in (1, 4)), 32
    )
    for zoi, order, k in ((32, 1, 4e-4), (32, 2, 8e-4), (64, 1, 1e-4))
)


def test_the_table_of_noise_has_lengths_in_mm_where_the_scale_is_known() -> None:
    figures: Any = SimpleNamespace(floors=FLOORS, zoi=32, order=2, px_per_mm=None)
    rows = [line.split() for line in table_lines(figures)[2:]]
    assert rows[0] == ["32", "1", "64", "16", "440", "(400)", "110", "(100)"]
    assert rows[1][:4] == ["*", "32", "2", "64"] and rows[2][:4] == ["64", "1", "128", "32"]
    figures.px_per_mm = 20.0
    assert table_lines(figures)[2].split()[:4] == ["32", "1", "3.20", "0.80"]


def test_what_reaches_a_noise_is_the_shortest_burst_of_each_size() -> None:
    found = [(floor.zoi, floor.order, burst) for floor, burst in reaching(FLOORS, 1.2e-4)]
    assert found == [(32, 1, 4), (64, 1, 1)]
    assert reaching(FLOORS, 1e-6) == []


def test_zois_are_drawn_in_the_colour_of_their_noise() -> None:
    """Good up to the target, fair up to twice of it, poor beyond; a cross without pattern."""
    grid = make_grid()
    sigma = np.full(grid.shape, 0.5e-3)
    sigma[1, :6] = 1e-3, 1.01e-3, 2e-3, 2.01e-3, math.nan, 0.1e-3
    overlay = Overlay(Region(None, None, ""), grid, sigma=sigma, target=1e-3)
    drawing = _Drawing.of(np.tile(np.arange(128, dtype=np.uint8), (96, 1)))
    drawing.quality(overlay, sigma)

    def colour(row: int, column: int) -> tuple[int, ...]:
        x, y = drawing.at(grid.x[column], grid.y[row])
        return tuple(drawing.canvas[y, x].tolist())

    assert [colour(1, k) for k in range(6)] == [GOOD, FAIR, FAIR, POOR, POOR, GOOD]
    assert colour(0, 0) not in (GOOD, FAIR, POOR), "it is switched off"


def lines(gauges: tuple[GaugeNoise, ...], **given: Any) -> dict[str, str]:
    """Cause to the rest of its line."""
    config = load_config(None, {key.replace("__", "."): value for key, value in given.items()})
    figures: Any = SimpleNamespace(gauges=gauges)
    return {line[2:24].strip(): line[24:].strip() for line in budget_lines(figures, config)[2:]}


def test_the_figures_by_value() -> None:
    gauges = GaugeNoise("axial", 5e-6), GaugeNoise("", 1e-6)
    found = lines(
        gauges, specimen__standard="iso527", specimen__area_mm2=10.0, specimen__force_error_percent=1.0,
        scale__stand_off_mm=400.0,
    )  # fmt: skip
    assert found["scatter"].split() == ["5", "0.2"]  # of 2500 um/m, and of E
    assert found["blur"] == "the test shows it"
    share = 1 / math.sqrt(3)
    assert [float(text) for text in found["load cell"].split()] == pytest.approx(
        [share * 25, share], rel=4e-3
    )
    assert found["section"] == "not stated: specimen.section_error_percent"
    assert found["motion off the plane"] == "not counted: 0.1 mm at 400 mm is 250 µm/m"
    assert float(found["combined"].split()[1]) == pytest.approx(math.hypot(0.2, share), rel=4e-3)


def test_in_gpa_where_a_modulus_is_expected() -> None:
    gauges = (GaugeNoise("axial", 5e-6),)
    found = lines(gauges, specimen__standard="iso527", specimen__modulus_GPa=70.0)
    assert found["scatter"].split() == ["5", "0.2", "0.14"]
    assert found["load cell"] == "not stated: specimen.force_error_percent"


def test_the_mean_of_the_region_without_a_gauge_along_the_load() -> None:
    found = lines((GaugeNoise("", 2e-6),), specimen__standard="iso6892")
    assert found["scatter"].split() == ["2", "0.2"]  # of 0.1 %
    assert "section" not in found
    assert found["strain"] == "not stated: specimen.strain_error_um_m"


def test_nothing_without_noise() -> None:
    assert lines(()) == {}


@pytest.mark.parametrize(
    ("readout_ms", "words"),
    [(None, "not stated: camera.readout_ms"), (0.0, "none"), (1.0, "removed"), (12.0, "removed")],
)
def test_the_rolling_shutter_is_removed_where_its_time_is_stated(
    readout_ms: float | None, words: str
) -> None:
    rows = budget_rows({"scatter": 0.01}, 1e-3, 100.0, CameraView(readout_ms=readout_ms), stresses=True)
    assert {row.cause: row.words for row in rows}["rolling shutter"] == words


def test_shares_combine_as_independent_ones_in_strain_and_in_the_modulus() -> None:
    shares = {"scatter": 0.03, "section": 0.04}
    found = {row.cause: row for row in budget_rows(shares, 2e-3, 70.0, CameraView(500.0), stresses=True)}
    assert (found["section"].strain, found["section"].modulus) == pytest.approx((8e-5, 2.8))
    assert (found["combined"].strain, found["combined"].modulus) == pytest.approx((1e-4, 3.5))
    assert found["motion off the plane"].words == "not counted: 0.1 mm at 500 mm is 200 µm/m"


CAMERA = CameraInfo("v4l2:", "a camera", 640, 512, 12, live=True, clock="device", fps=30.0)
FRAME = 640 * 512 * 2


def stack(fps: float = 20.0, **camera: Any) -> FrameStack:
    """Nine frames as they came, which may be fewer a second than the camera says."""
    frames, times = np.zeros((9, 512, 640), np.uint16), np.arange(9) / fps
    return FrameStack(frames, times, 0, replace(CAMERA, **camera))


@pytest.mark.parametrize(
    ("given", "bytes_a_frame"),
    [
        ({}, FRAME),
        ({"record.mode": "every=5"}, FRAME / 5),
        ({"record.mode": "bursts"}, 640 * 512 * (2 + 1 / 8) / 4),
        ({"record.mode": "bursts", "measure.burst": 20}, 640 * 512 * (4 + 1 / 8) / 20),
        ({"record.enabled": False}, 0),
        ({"camera.back": "v4l2:other"}, 2 * FRAME),
    ],
)
def test_what_is_written_is_that_of_the_frames_that_come(given: dict[str, Any], bytes_a_frame: float) -> None:
    assert write_rate(stack(), load_config(None, given)) == pytest.approx(20 * bytes_a_frame)


def test_a_folder_of_pictures_is_not_recorded() -> None:
    assert write_rate(stack(live=False), load_config(None, {})) == 0
    assert disk_lines(0.0, load_config(None, {})) == []


@pytest.mark.parametrize(
    ("free", "seconds", "good", "shown"),
    [
        (90e6, None, False, "room for 0.1 min at this rate (13.1 MB/s, 0.09 GB free)"),
        (7.8e9, None, False, "room for 9.9 min at this rate"),
        (7.9e9, None, True, "room for 10 min at this rate"),
        (90e6, 6.0, True, "room for 0.1 min at this rate"),
        (90e6, 8.0, False, "room for 0.1 min at this rate"),
        (7.9e9, 3600.0, False, "room for 10 min at this rate"),
    ],
)
def test_it_must_last_for_the_test_or_ten_minutes(
    monkeypatch: pytest.MonkeyPatch, free: float, seconds: float | None, good: bool, shown: str
) -> None:
    config = load_config(None, {} if seconds is None else {"output.seconds": seconds})
    monkeypatch.setattr(check_line, "free_bytes", lambda folder: free)
    (line,) = disk_lines(20 * FRAME, config)
    assert line.good is good and line.value.startswith(shown)
    assert f"for a test of {(seconds or 600) / 60:.3g} min: free some space" in line.advice


def test_a_disk_that_is_gone_is_no_go(monkeypatch: pytest.MonkeyPatch) -> None:
    def gone(folder: str) -> int:
        raise OSError(5, "Input/output error")

    monkeypatch.setattr(check_line, "free_bytes", gone)
    (line,) = disk_lines(1e6, load_config(None, {"output.dir": "/mnt/usb/run"}))
    assert not line.good and line.value == "/mnt/usb/run: cannot be asked (Input/output error)"
