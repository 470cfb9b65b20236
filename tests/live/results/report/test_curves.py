"""Plots, SVG and the files of figures, by value."""

from __future__ import annotations

import re
import subprocess
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from acquire.errors import ConfigError, DataError
from analysis.evaluate import Figure, true_curve
from live.pipeline.screen import Screen
from live.results.maps.colours import MICROSTRAIN
from live.results.report import curves, saving
from live.results.report.curves import load_unit, strain_unit, stress_strain, true_stress_strain
from live.results.report.evaluation import EvaluatedCurve, lag_of, neck_line, time_steps
from live.results.report.saving import as_csv, save_figures, save_page, save_pdf, to_pdf, to_png
from live.results.report.svg import Mark, Plot, PlotLine, draw
from live.results.run_folder import open_run
from tests.live.made_run import CONFIG, E_PA, GAUGES, PULLED, force_of, make_run

N = len(PULLED)
AREA_M2 = 20e-6


# -- plots ----------------------------------------------------------------------------------------


def test_the_force_over_time_is_that_of_the_load_cell(run_dir: Path, tmp_path: Path) -> None:
    """Of the samples of the recording, else of the results; in kN from 2 kN on."""
    with open_run(run_dir) as run:
        samples, unit = curves.force(run), "force, kN"
        run.__dict__["load_samples"] = []
        stored = curves.force(run)
        run.strain.values["force_N"][:] = np.nan
        assert curves.force(run) is None
    for plot in (samples, stored):
        assert plot is not None and plot.y_label == unit and plot.x_label == "time, s"
        np.testing.assert_allclose(plot.curves[0].x, 0.1 * np.arange(N), atol=1e-9)
        np.testing.assert_allclose(plot.curves[0].y, [1e-3 * force_of(e) for e in PULLED], rtol=1e-6)
        assert plot.x_range == (0.0, pytest.approx(0.1 * (N - 1)))


def test_the_strains_of_the_region_have_their_sigma_as_band(run_dir: Path) -> None:
    with open_run(run_dir) as run:
        plot, values = curves.mean_strains(run), run.strain.values
    assert [line.label for line in plot.curves] == ["exx", "eyy", "exy"]
    assert [line.colour for line in plot.curves] == [0, 1, 2]
    for line in plot.curves:
        assert line.sigma is not None
        np.testing.assert_allclose(line.y, 1e6 * values[line.label])
        np.testing.assert_allclose(line.sigma, 1e6 * values[f"sigma_{line.label}"])
    assert plot.y_label == "strain, µm/m"


def test_the_axis_of_time_begins_at_zero_and_has_a_length() -> None:
    def ranged(*times: float) -> tuple[float, float]:
        run: Any = SimpleNamespace(strain=SimpleNamespace(time_s=np.array(times)))
        return curves.time_range(run)

    assert ranged(2.0, 5.0) == (0.0, 5.0)
    assert ranged(-1.0, 5.0) == (-1.0, 5.0)
    assert ranged(0.0) == (0.0, 1.0) and ranged(-2.0) == (-2.0, -1.0)


def test_strains_for_a_part_of_their_area_are_told() -> None:
    def told(**values: list[float]) -> str:
        columns = {name: np.array(column) for name, column in values.items()}
        run: Any = SimpleNamespace(
            strain=SimpleNamespace(values=columns, time_s=np.array([0.0, 1.5, 2.5, 3.5]))
        )
        return curves.parts(run)

    whole = [1.0, 1.0, 1.0, 1.0]
    assert told(area_share=whole) == told(eyy=whole) == ""
    words = told(area_share=[1.0, 0.9, 1.0, 1.0], share_gauge_a=[1.0, 1.0, 0.625, 1.0])
    assert words.startswith("A block of ZOIs had no value at 2 of 4 instants, between 1.5 and 2.5 s:")
    assert words.endswith("62 % at the least.")


def test_units_of_strain_and_load() -> None:
    assert strain_unit(np.array([0.001, np.nan]), np.array([-0.02])).name == "%"
    assert strain_unit(np.array([0.0199, -0.0199])) == strain_unit(np.array([np.nan])) == MICROSTRAIN
    curve: Any = SimpleNamespace(is_stress=True, load=np.array([1e3]))
    assert (load_unit(curve).name, load_unit(curve).factor) == ("MPa", 1e-6)
    curve.is_stress = False
    assert (load_unit(curve).name, load_unit(curve).factor) == ("N", 1.0)


def test_the_highest_stress_and_the_lines_of_e(run_dir: Path) -> None:
    with open_run(run_dir) as run:
        curve = EvaluatedCurve.of(run)
    plot, top = stress_strain(curve), force_of(PULLED[-1]) / AREA_M2
    highest = plot.marks[-1]
    assert highest.words == "Rm = 210.5 MPa" and highest.y == pytest.approx(1e-6 * top, rel=1e-6)
    assert highest.x == pytest.approx(1e6 * curve.axial[-1])
    elastic = plot.curves[1]
    assert elastic.label == "E" and elastic.dashed and elastic.y.tolist() == pytest.approx([0, 1.05e-6 * top])
    assert np.diff(elastic.y)[0] / np.diff(elastic.x)[0] == pytest.approx(E_PA * 1e-12, rel=0.01)
    assert elastic.x[0] == pytest.approx(0.0, abs=30.0)
    assert (plot.x_label, plot.y_label) == ("axial strain, µm/m", "stress, MPa")
    forces = stress_strain(replace(curve, is_stress=False))
    assert forces.curves[1].label == "EA" and forces.marks[-1].words.startswith("Fm = ")
    assert forces.y_label == "force, kN"


def test_true_stress_is_known_up_to_the_highest_force(run_dir: Path) -> None:
    with open_run(run_dir) as run:
        curve = EvaluatedCurve.of(run)
    axial, load = np.array([0.0, 0.01, 0.03, 0.06]), np.array([0.0, 2e8, 3e8, 1e8])
    past = replace(curve, axial=axial, load=load, figures=replace(curve.figures, Ag=Figure(0.02, 0.01, 0.03)))
    plot = true_stress_strain(past)
    assert plot is not None and (plot.x_label, plot.y_label) == ("true strain, %", "true stress, MPa")
    strain, stress = true_curve(axial, load)
    np.testing.assert_allclose(plot.curves[0].x, 100 * strain)
    np.testing.assert_allclose(plot.curves[0].y, 1e-6 * stress)
    assert np.nanmax(plot.curves[0].y) == pytest.approx(300 * 1.03)
    assert true_stress_strain(replace(past, is_stress=False)) is None
    unknown = replace(past.figures, Ag=Figure.none("not passed"))
    assert true_stress_strain(replace(past, figures=unknown)) is None


# -- the evaluation -------------------------------------------------------------------------------


def test_the_instants_without_a_force(run_dir: Path) -> None:
    with open_run(run_dir) as run:
        run.strain.values["force_N"][:] = np.nan
        run.strain.values["stress_Pa"][:] = np.nan
        curve = EvaluatedCurve.of(run)
        axial = curve.axial.copy()
        axial[40] = -0.5
        assert time_steps(run, replace(curve, axial=axial)) == {
            0: "first", 40: "largest strain", N - 1: "last",
        }  # fmt: skip
    assert not curve.has_load and not curve.elastic.any() and np.isnan(curve.intercept)


def test_the_neck_is_told_between_the_highest_force_and_the_break(
    run_dir: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Below 2 % of the highest force there is no specimen any more."""
    asked: list[tuple[int, int, str]] = []
    grown = SimpleNamespace(x=80.4, y=40.6, growth=0.123, elsewhere=0.0045)
    monkeypatch.setattr(
        "live.results.report.evaluation.neck",
        lambda top, last, axis: asked.append((top, last, axis)) or grown,
    )
    with open_run(run_dir) as run:
        curve = EvaluatedCurve.of(run)
        curve = replace(curve, figures=replace(curve.figures, Ag=Figure(0.02, 0.01, 0.03)))
        load = curve.load.copy()
        load[50], load[80:90], load[90:] = 1e9, 0.021e9, 0.019e9
        monkeypatch.setattr(type(run), "field", lambda self, row: row)
        past = replace(curve, load=load)
        words = neck_line(run, past)
        run.strain.config["scale"] = {"mm_per_px": 0.1}
        with_scale = neck_line(run, past)
        unknown = replace(past, figures=replace(past.figures, Ag=Figure.none("")))
        assert neck_line(run, unknown) == ""
        load[51:] = 0.0
        assert neck_line(run, replace(past, load=load)) == "", "it broke at once"
        run.strain.values["n_valid"][50] = 0
        load[49] = 0.9e9
        assert neck_line(run, replace(past, load=load)) == ""
    assert asked == [(50, 89, "y")] * 2
    assert words == (
        "neck at x, y = 80, 41 px: from the highest force at 5 s to 8.9 s the strain there grew by 12 %,"
        " elsewhere by 0.45 %"
    )
    assert "80, 41 px (8.0, 4.1 mm): " in with_scale


def test_the_lag_is_found_from_readings_since_the_start(
    run_dir: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    given: list[Any] = []
    monkeypatch.setattr("live.results.report.evaluation.find_lag", lambda *tracks: given.append(tracks))
    with open_run(run_dir) as run:
        lag_of(run)
        axial = run.axial_strain
    ((strain, load),) = given
    for track in (strain, load):
        np.testing.assert_allclose(track.t, 0.1 * np.arange(N), atol=1e-9)
    np.testing.assert_array_equal(strain.values, axial)
    np.testing.assert_allclose(load.values, [force_of(e) for e in PULLED])


# -- SVG ------------------------------------------------------------------------------------------


def numbers(text: str) -> list[float]:
    return [float(word) for word in re.findall(r"-?\d+(?:\.\d+)?", text)]


def test_a_line_is_drawn_from_left_to_right_and_upwards() -> None:
    """The axes are 492 px wide and 238 high, from (74, 26) to (566, 264)."""
    line = PlotLine(
        "a", np.array([0.0, 5.0, 10.0]), np.array([0.0, 10.0, 20.0]), np.array([1.0, 2.0, 1.0]), 2
    )
    svg = draw(Plot("f", "t", "x", "y", (line,), (Mark(5.0, 10.0, "here"), Mark(9.5, 20.0, "there")),
                    (0.0, 10.0), (0.0, 20.0)))  # fmt: skip
    path = re.search(r'class="curve c2" d="(M74[^"]+)"', svg)
    assert path is not None and numbers(path[1]) == [74, 264, 320, 145, 566, 26]
    band = re.search(r'class="band f2" points="([^"]+)"', svg)
    assert band is not None
    # Forth along the lower edge, back along the upper one.
    assert numbers(band[1]) == pytest.approx(
        [74, 275.9, 320, 168.8, 566, 37.9, 566, 14.1, 320, 121.2, 74, 252.1], abs=0.06
    )
    circles = re.findall(r'<circle class="f3" cx="([\d.]+)" cy="([\d.]+)"', svg)
    assert circles == [("320.0", "145.0"), ("541.4", "26.0")]
    assert '<text class="word" x="328.0" y="163.0" text-anchor="start">here<' in svg
    assert '<text class="word" x="533.4" y="44.0" text-anchor="end">there<' in svg
    assert '<text class="word" x="172.4" y="280.0" text-anchor="middle">2<' in svg
    assert '<text class="word" x="68.0" y="149.0" text-anchor="end">10<' in svg


def test_axes_leave_room_around_data_and_bands() -> None:
    def down(y: list[float], sigma: list[float] | None = None, dashed: float = 0.0) -> list[float]:
        band = None if sigma is None else np.array(sigma)
        lines = [PlotLine("", np.arange(float(len(y))), np.array(y), band)]
        if dashed:
            lines.append(PlotLine("", np.array([0.0, 1.0]), np.array([0.0, dashed]), dashed=True))
        found = re.search(r'class="curve c0" d="([^"]+)"', draw(Plot("f", "t", "x", "y", tuple(lines))))
        assert found is not None
        return numbers(found[1])[1::2]

    # 3 % of the span on either side, within 238 px.
    edge = 238 * 0.03 / 1.06
    assert down([0.0, 1.0]) == pytest.approx([264 - edge, 26 + edge], abs=0.06)
    assert down([0.0, 1.0], dashed=50.0) == down([0.0, 1.0]), "a construction does not widen the axes"
    wide = down([0.0, 1.0], [0.5, 1.0])
    assert wide == pytest.approx(
        [264 - edge - (238 - 2 * edge) / 5, 26 + edge + (238 - 2 * edge) * 2 / 5], abs=0.06
    )
    assert down([4.0, 4.0]) == pytest.approx([145, 145]), "a constant lies in the middle"
    assert down([0.0, 0.0]) == pytest.approx([145, 145])


def test_a_gap_interrupts_the_line() -> None:
    y = np.array([0.0, 1.0, np.nan, 3.0, 4.0])
    svg = draw(Plot("f", "t", "x", "y", (PlotLine("", np.arange(5.0), y),), (), (0, 4), (0, 4)))
    found = re.search(r'class="curve c0" d="([^"]+)"', svg)
    assert found is not None and re.sub(r"[\d. ]", "", found[1]) == "MLML"


def test_the_legend_names_each_line_in_its_colour() -> None:
    lines = tuple(PlotLine(name, np.arange(2.0), np.arange(2.0), colour=k, dashed=k == 1)
                  for k, name in enumerate(("ab", "c<d", "")))  # fmt: skip
    svg = draw(Plot("f", "t", "x", "y", lines))
    assert '<path class="curve c0" d="M74 12h22"/>' in svg and ">ab</text>" in svg
    assert '<path class="curve c1 dashed" d="M129 12h22"/>' in svg and ">c&lt;d</text>" in svg
    assert svg.count(" 12h22") == 2
    assert "c1" in draw(Plot("f", "t", "x", "y", (replace(lines[0], colour=7),)))


def test_only_long_lines_are_thinned() -> None:
    for n, drawn in ((1600, 1600), (1601, None)):
        svg = draw(Plot("f", "t", "x", "y", (PlotLine("", np.arange(n * 1.0), np.arange(n * 1.0)),)))
        found = re.search(r'class="curve c0" d="([^"]+)"', svg)
        assert found is not None
        points = len(re.findall("[ML]", found[1]))
        assert points == drawn if drawn else points <= 1602


# -- files ----------------------------------------------------------------------------------------


class Said(Screen):
    """Keeps the lines."""

    def __init__(self) -> None:
        self.lines: list[str] = []

    def print(self, text: str = "") -> None:
        self.lines.append(text)


PLOT = Plot("f", "a title", "x, s", "y, N", (
    PlotLine('say "a"', np.array([1.0, 2.0]), np.array([3.0, 4.0]), np.array([0.5, 0.25])),
    PlotLine("b", np.array([1.0]), np.array([np.nan])),
))  # fmt: skip


def test_the_points_of_a_figure_as_csv() -> None:
    assert as_csv(PLOT).splitlines() == [
        "# a title; x: x, s; y: y, N", "curve,x,y,sigma", "\"say 'a'\",1,3,0.5", "\"say 'a'\",2,4,0.25",
        '"b",1,nan,nan',
    ]  # fmt: skip


@pytest.fixture
def browser(monkeypatch: pytest.MonkeyPatch) -> list[list[str]]:
    """A browser that writes what it is asked for, or nothing where the page is named so."""
    asked: list[list[str]] = []

    def run(command: list[str], **how: Any) -> Any:
        asked.append(command)
        assert how["timeout"] > 10 and how["check"] is False
        if "slow" in command[-1]:
            raise subprocess.TimeoutExpired(command, 120)
        target = next(word.partition("=")[2] for word in command if word.startswith(("--print", "--screens")))
        if "broken" not in command[-1]:
            Path(target).write_bytes(b"made" if "empty" not in command[-1] else b"")
        return SimpleNamespace(stderr=b"first\nno display\n")

    monkeypatch.setattr(saving, "find_browser", lambda: "/usr/bin/chromium")
    monkeypatch.setattr(saving.subprocess, "run", run)
    return asked


def test_a_browser_makes_pdf_and_png(tmp_path: Path, browser: list[list[str]]) -> None:
    page, pdf, png = (tmp_path / f"a.{end}" for end in ("html", "pdf", "png"))
    to_pdf(page, pdf)
    to_png(page, png, 580, 310)
    first, second = browser
    assert first[0] == "/usr/bin/chromium" and "--headless=new" in first
    assert first[-1] == second[-1] == page.as_uri()
    assert f"--print-to-pdf={pdf}" in first and "--no-pdf-header-footer" in first
    assert f"--screenshot={png}" in second and "--window-size=580,310" in second
    save_pdf(page, tmp_path / "b.pdf")
    assert (tmp_path / "b.pdf").read_bytes() == b"made"


@pytest.mark.parametrize(
    ("name", "words"),
    [("broken", r"failed on broken.html \(no display\)"), ("empty", "failed on empty.html"),
     ("slow", "did not finish .* within 120 s")],
)  # fmt: skip
def test_a_browser_that_fails_is_told(
    tmp_path: Path, browser: list[list[str]], name: str, words: str
) -> None:
    with pytest.raises(DataError, match=words + ".*; open .* in a browser and print it"):
        save_pdf(tmp_path / f"{name}.html", tmp_path / "a.pdf")
    assert not (tmp_path / "a.pdf").exists()


def test_without_a_browser_there_are_svg_and_csv(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(saving, "find_browser", lambda: None)
    screen = Said()
    save_figures([PLOT], tmp_path / "figures", screen)
    assert {path.name for path in (tmp_path / "figures").iterdir()} == {"f.svg", "f.csv"}
    assert 'fill="#fff"' in (tmp_path / "figures/f.svg").read_text()
    assert screen.lines == [f"warning: {saving.NO_PNG}"]
    with pytest.raises(ConfigError, match="no browser was found"):
        to_pdf(tmp_path / "a.html", tmp_path / "a.pdf")


def test_with_a_browser_there_are_png_too(tmp_path: Path, browser: list[list[str]]) -> None:
    screen = Said()
    save_figures([PLOT, replace(PLOT, name="g")], tmp_path / "figures", screen)
    assert {path.name for path in (tmp_path / "figures").glob("*.png")} == {"f.png", "g.png"}
    assert screen.lines == [] and len(browser) == 2
    save_figures([replace(PLOT, name="broken")], tmp_path / "others", screen)
    assert len(screen.lines) == 1 and "SVG and CSV without PNG: " in screen.lines[0]
    save_page(SimpleNamespace(html="é"), tmp_path / "p.html")  # type: ignore[arg-type]
    assert (tmp_path / "p.html").read_bytes() == "é".encode()


def test_gauges_are_drawn_in_their_order(tmp_path: Path, run_dir: Path) -> None:
    with open_run(make_run(tmp_path, PULLED[:12], config={**CONFIG, "gauges": GAUGES})) as run:
        plot = curves.gauge_strains(run)
        assert plot is not None and plot.y_label == "strain, µm/m"
        for k, (line, (name, gauge)) in enumerate(zip(plot.curves, run.gauges.items(), strict=True)):
            assert (line.label, line.colour) == (name, k)
            np.testing.assert_allclose(line.y, 1e6 * gauge.value)
    with open_run(run_dir) as run:
        assert curves.gauge_strains(run) is None
