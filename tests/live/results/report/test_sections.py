"""Sections of a report, by value: rig, gauges, times, events, noise, lens, maps."""

from __future__ import annotations

import base64
import hashlib
import html
import math
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest

from acquire.events import Event, EventKind
from acquire.frame import CameraInfo
from analysis.evaluate import Figure, NoiseFloor
from live.pipeline.consumer import Screen
from live.results.finished.finished_test import FinishedTest
from live.results.maps.colours import diverging_table, sequential_table
from live.results.maps.scale import ColourScale
from live.results.report import record, report
from live.results.report.evaluation import EvaluatedCurve, still_phase_of
from live.results.report.maps import _bar, map_pictures, maps, statuses
from live.results.report.record import (
    PracticeValues,
    events,
    gauges,
    hashes,
    reporting_table,
    times,
    version_table,
)
from live.results.report.report import ReportRequest, make_report, tensile
from live.results.run_folder import RunFolder, open_run
from tests.live.made_run import CONFIG, GAUGES, PULLED, make_run
from tests.live.screens import RecordingScreen

N = len(PULLED)


def plain(text: str) -> str:
    """Without markup; cells apart by bars."""
    return html.unescape(re.sub(r"\|+", "|", re.sub("<[^>]*>", "|", text)))


def test_gauges_have_their_largest_and_last_strain_and_how_often_they_were_lost(tmp_path: Path) -> None:
    with open_run(make_run(tmp_path, PULLED[:12], config={**CONFIG, "gauges": GAUGES})) as run:
        values = run.strain.values
        values["gauge_axial"][:], values["sigma_gauge_axial"][:] = 1e-4, 2e-6
        values["gauge_axial"][[2, 3, 5]] = -3e-3, math.nan, math.nan
        values["gauge_shear"][:], values["sigma_gauge_shear"][:] = math.nan, math.nan
        found = plain(gauges(run))
    assert "|axial|kind line; start 64, 20; end 64, 76|3 000 µm/m|100 ± 2 µm/m|2|" in found
    assert "value exy|not known|not known|12|" in found


def lagging(run: RunFolder) -> FinishedTest:
    return replace(FinishedTest.of_folder(run), lag=Figure(0.0123, 0.0103, 0.0143))


def test_times_of_the_load_and_of_the_results(run: RunFolder) -> None:
    run.strain.values["latency_s"] = np.array([*np.arange(101) * 1e-3, math.nan])
    run.strain.config["load"] = {"lag_s": 0.025}
    found = plain(times(run, lagging(run)))
    assert "|12.3 ± 2.0 ms (95% interval; positive: the load is late)|" in found
    assert "|lag corrected in the force|0.025 s|" in found
    assert "|from the last frame of a burst to its result|p50 50 ms, p95 95 ms|" in found
    run.strain.config["load"], run.strain.values["latency_s"] = {"lag_s": 0.0}, np.full(3, math.nan)
    found = plain(times(run, lagging(run)))
    assert "|lag corrected in the force|none|" in found and "p95" not in found


def test_events_count_from_the_start_and_are_bounded(run: RunFolder, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(record, "_MAX_EVENTS", 2)
    start = run.start_monotonic
    happened = [Event(start + t, EventKind.NOTE, "operator", f"at {t:g}", "error") for t in (0.5, 1.25, 2.0)]
    run.__dict__["events"] = happened
    found = plain(events(run))
    assert "|0.500|error|note|operator|at 0.5|" in found and "|1.250|" in found and "at 2" not in found
    assert "1 more events are in session.h5." in found
    run.__dict__["events"] = happened[:2]
    assert "more events" not in plain(events(run))
    run.__dict__["events"] = []
    assert "No events were recorded." in plain(events(run))


def test_repeated_events_are_one_line_with_their_number_and_the_time_of_the_last(run: RunFolder) -> None:
    start = run.start_monotonic
    run.__dict__["events"] = [
        Event(start + t, EventKind.ALARM, "alarm", f"alarm high: force is {t} N", "warning")
        for t in range(1494)
    ]
    found = plain(events(run))
    assert found.count("alarm high") == 4
    assert "|1\u202f493.000|warning|alarm|alarm|alarm high: force is 1493 N (1 494 times)|" in found


def test_versions_then_and_now(run: RunFolder, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(record, "versions", lambda: {"phasedic": "9.9", "numpy": "2"})
    found = plain(version_table(run))
    assert "|phasedic|0.1.0|9.9|" in found and "|numpy|2|" in found and "|python|3.11|" in found


def test_the_files_with_size_and_hash(run: RunFolder, tmp_path: Path) -> None:
    copied = tmp_path / "session.h5"
    copied.write_bytes(bytes(1_234_567))
    run.path = tmp_path
    (tmp_path / "notes.txt").write_text("not of the run")
    screen = RecordingScreen()
    found = plain(hashes(run, screen))
    digest = hashlib.sha256(copied.read_bytes()).hexdigest()
    assert f"|session.h5|1\u202f234\u202f567|{digest}|" in found and "notes" not in found
    assert screen.statuses == ["reading session.h5 for its hash"]
    assert record._sha256(tmp_path / "gone.h5").startswith("cannot be read: No such file")


def test_the_rig_in_words(run: RunFolder) -> None:
    camera = CameraInfo("v4l2:", "a camera", 1280, 960, 12, True, "device", fps=25.0, warnings=("it is hot",))
    found = report._rig(run, SimpleNamespace(camera=camera))  # type: ignore[arg-type]
    assert found["section"] == "10 mm x 2 mm" and found["load along"] == "y of the picture"
    assert found["camera"] == "a camera: 1280 x 960 px, 12 bits, 25 frames/s, clock: device"
    assert found["load cell"] == "made-up cell, capacity 5000 N"
    assert found["warnings of the devices"] == "it is hot" and found["lens"] == "50 mm"
    assert found["ZOIs"] == "34 of 32 px, 16 px apart, region x,y,w,h = 0,0,128,96 px"
    assert found["camera address"] == "sim:made-up"


def test_the_head_of_the_report(run: RunFolder) -> None:
    curve = EvaluatedCurve.of(run)
    extent = report._extent(run, replace(curve, axial=np.array([0.0, -0.03, 0.01, math.nan])))
    assert extent["ZOIs with a value, last"] == "33 of 34"
    assert extent[f"largest {curve.figures.strain}"] == "−3 %"
    head = plain(report._head(run, curve, FinishedTest.of_folder(run)))
    assert f"Test of 2030-01-02T03:04:05+00:00: {N} measurements in 9.5 s." in head
    assert "not closed" not in head
    run.strain.unfinished = True
    assert "The results were not closed by their writer" in report._head(
        run, curve, FinishedTest.of_folder(run)
    )


def test_the_words_under_the_curves(run: RunFolder) -> None:
    curve = EvaluatedCurve.of(run)
    span = curve.figures.span
    assert span is not None
    low, high = (100 * strain for strain in span.strain)
    words = plain(report._about_curves(curve))
    assert (
        f"The elastic line has {span.n} instants between the strains {low:.3g} and {high:.3g} % (iso6892,"
        in words
    )
    assert "E is not known" not in words
    unknown = replace(curve, figures=replace(curve.figures, E=Figure.none("too short"), span=None))
    assert plain(report._about_curves(unknown)).endswith("on either side. E is not known: too short|")
    assert not report.figure_table(run, replace(curve, load=np.full(N, math.nan)))


def test_the_noise_floor_by_map(run: RunFolder) -> None:
    floors = {"u": NoiseFloor(0.004, 0.005), "exx": NoiseFloor(42e-6, 40e-6), "exy": NoiseFloor(1e-6, 0.0)}
    content: Any = SimpleNamespace(run=run, still=SimpleNamespace(time_steps=8, floors=floors))
    found = plain("".join(report._noise_section(content)))
    assert "|u|0.004|0.005|px|0.80|" in found and "|exx|42|40|µm/m|1.05|" in found
    assert "|exy|1|0|µm/m|not known|" in found
    assert "in the first 8 instants (to 0.7 s)" in found


def test_the_still_phase_is_measured(run: RunFolder) -> None:
    """Eight instants at rest, with a noise of 1e-5 in each gradient."""
    still = still_phase_of(run.strain)
    assert still.time_steps == 8 and set(still.floors) == {"u", "v", "exx", "eyy", "exy"}
    for name, sigma in (("u", 1e-5), ("exx", 1e-5), ("exy", 1e-5 / math.sqrt(2))):
        assert still.floors[name].measured == pytest.approx(sigma, rel=0.15), name
        assert still.floors[name].predicted == pytest.approx(sigma, rel=0.02), name
    assert set(still_phase_of(run.strain, ("eyy",)).floors) == {"eyy"}


def test_what_a_lens_made_is_told(run: RunFolder) -> None:
    assert report._lens_section(run) == []
    columns = {"lens_exx": [-30e-6, 5e-6], "lens_eyy": [math.nan, 20e-6], "sigma_lens_exx": [2e-6, 1e-6],
               "sigma_lens_eyy": [math.nan, 3e-6]}  # fmt: skip
    run.strain.values.update({name: np.array(values) for name, values in columns.items()})
    run.strain.config["lens"] = {"date": "2030-01-01", "method": "a board"}
    (found,) = map(plain, report._lens_section(run))
    assert "Calibrated 2030-01-01: a board. Up to 30 µm/m of exx and 20 of eyy" in found
    assert "known to 2 and 3;" in found


def test_the_sharpness_is_told_where_it_is_known(run: RunFolder) -> None:
    run.strain.values["blur_px"], run.strain.values["sigma_blur_px"] = (
        np.array([0.1, -0.4]),
        np.array([0.02, 0.03]),
    )
    (found,) = map(plain, report._sharpness_section(run))
    assert "sharper by 0.40 ± 0.03 px at most, sharper by 0.40 ± 0.03 px in the last picture" in found
    run.strain.values["blur_px"] = np.full(2, math.nan)
    assert report._sharpness_section(run) == []
    del run.strain.values["blur_px"]
    assert report._sharpness_section(run) == []


def test_the_reporting_table_has_what_was_measured_with(run: RunFolder) -> None:
    run.strain.config["measure"] = {"order": 2, "window": "uniform"}
    run.strain.config["camera"] = {"dark": "d.png", "flat": "f.png"}
    run.strain.metadata |= {"Field-of-view": "30 mm", "exposure": "8 ms"}
    found = plain(reporting_table(PracticeValues(run, None, None, {}, None)))
    for words in (
        "|Subset shape function|quadratic (12 parameters)|", "|Subset size (ZOI)|32 px, uniform weight|",
        "|Step size|16 px|", "spectrum; dark frame; flat frame|", "|Frames averaged|8; reference 8|",
        "|Virtual strain gauge size|32 px, one ZOI|", "|Strain formulation|small|", "|Field of view|30 mm|",
        "|Exposure time|8 ms|", "|Image resolution|not recorded|", "|DIC software|phasedic 0.1.0, phase-DIC|",
        "|Camera|not recorded (phasedic run --meta camera=...)|", "|Strain noise floor|not recorded|",
    ):  # fmt: skip
        assert words in found, words
    del run.strain.config["measure"]["order"]
    assert "|affine (6 parameters)|" in plain(reporting_table(PracticeValues(run, None, None, {}, None)))


def pictures_in(text: str) -> list[np.ndarray]:
    return [
        cv2.imdecode(np.frombuffer(base64.b64decode(one), np.uint8), cv2.IMREAD_COLOR)
        for one in re.findall(r"base64,([^\"]+)", text)
    ]


def test_each_map_lies_beside_the_picture_of_its_instant(run: RunFolder) -> None:
    rows = {0: "first", N - 1: "last"}
    pictures = map_pictures(run, list(rows))
    assert pictures.size == (128, 96) and pictures.camera is not None
    for row, image in pictures.images.items():
        assert image is not None and int(image[0, 0]) in (100 + 8 * row + 3, 100 + 8 * row + 4)
    text = maps(run, "eyy", rows, pictures, 320)
    drawn = pictures_in(text)
    assert [one.shape for one in drawn] == [(240, 320, 3)] * 4
    # Grey beside colours: violet at first, yellow at the end.
    grey, still, _, strained = (one.astype(int) for one in drawn)
    assert np.ptp(grey[120, 160]) < 8
    assert still[120, 160, 0] - still[120, 160, 1] > 40 and strained[120, 160, 1] - strained[120, 160, 0] > 40
    assert re.findall(r'alt="([^"]+)"', text) == [
        "picture, first",
        "eyy, first",
        "picture, last",
        "eyy, last",
    ]
    shown = plain(text)
    assert "first: t = 0.000 s   F = 0.0 N" in shown and "last: t = 9.500 s   F = 4\u202f210.0 N" in shown
    run.__dict__["pictures"] = None
    without = map_pictures(run, [3])
    assert (without.images, without.levels, without.size) == ({3: None}, None, (128, 96))
    assert len(pictures_in(maps(run, "eyy", {3: "a"}, without, 320))) == 1


def test_the_bar_of_a_map_has_its_colours_and_numbers() -> None:
    bar = _bar("eyy", ColourScale(-2.0, 2.0, "%", 100.0, True))
    boxes = re.findall(r'<rect x="([\d.]+)"[^>]*fill="rgb\((\d+),(\d+),(\d+)\)"', bar)
    assert len(boxes) == 48 and boxes[0][0] == "10.0" and boxes[-1][0] == "480.0"
    table = diverging_table()
    assert [int(v) for v in boxes[0][1:]] == table[0].tolist()
    assert [int(v) for v in boxes[-1][1:]] == table[-1].tolist()
    words = {text: float(x) for x, text in re.findall(r'x="([\d.]+)" y="34">([^<]+)<', bar)}
    assert words["−2"] == 10.0 and words["0"] == 250.0 and words["+2"] == 490.0
    assert 'd="M250 4v14"' in bar, "zero is marked"
    plain_bar = _bar("eyy", ColourScale(0.0, 2.0, "%", 100.0))
    assert f'fill="rgb{tuple(sequential_table()[0].tolist())}"'.replace(" ", "") in plain_bar
    assert "M250 4v14" not in plain_bar and ">2</text>" in plain_bar
    assert 'aria-label="colours of eyy from -2 to 2 %"' in bar


def test_the_statuses_are_counted(run: RunFolder) -> None:
    text = statuses(run, 0, map_pictures(run, [0]), 320)
    assert "|33 OK: " in plain(text) and "|1 POOR_MATCH: " in plain(text) and "NOT_MEASURED" not in text
    assert "t = 0.000 s" in plain(text) and len(pictures_in(text)) == 1


def test_a_report_shows_the_fields_and_instants_asked_for(run: RunFolder) -> None:
    made = make_report(run, ReportRequest(("exx",), (2.04,)), Screen())
    shown = plain(made.html)
    assert "chosen: t = 2.000 s" in shown and "|exx, µm/m|" in shown and "|eyy, µm/m|" not in shown
    assert list(tensile(EvaluatedCurve.of(run))) == ["E", "nu", "Rp0.2", "Rm", "strain of E, nu"]


@pytest.mark.parametrize(("known", "told"), [("E", True), ("nu", False)])
def test_the_strain_is_that_of_e(run: RunFolder, known: str, told: bool) -> None:
    curve = EvaluatedCurve.of(run)
    other = "nu" if known == "E" else "E"
    figures = replace(curve.figures, **{other: Figure.none("no")})
    found = tensile(replace(curve, figures=figures))
    assert known in found and other not in found and ("strain of E, nu" in found) is told
