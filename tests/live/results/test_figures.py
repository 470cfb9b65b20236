"""The figures of a test in words, by the standard that the configuration names."""

from __future__ import annotations

import math
import re
from dataclasses import astuple, replace
from typing import Any

import numpy as np
import pytest

from acquire.errors import ConfigError
from acquire.events import Event, EventKind
from acquire.load_cell import LoadLog
from acquire.load_sample import LoadSample
from analysis.evaluate import KINDS, Figure
from live.config.loading import load_config
from live.config.sections import SpecimenConfig
from live.pipeline.event_log import EventLog
from live.pipeline.history import History
from live.pipeline.run_state import FrameCounts, RunState
from live.results.budget import CameraView, budget_cells, budget_rows
from live.results.figures import (
    alignment_line,
    budget_of,
    elastic_lines,
    evaluate,
    figure_lines,
    figure_text,
    lag_line,
    lag_of,
    sharpness_line,
    tensile_options,
    tensile_table,
)
from live.results.report.several import _summary as summary_of_rows
from live.results.summary import latency_lines, noise_line, summary_lines
from tests.analysis.curves import Truth, composite, noisy, ramberg_osgood
from tests.live.made_run import finished
from tests.live.made_up import START, in_ascii, make_measurement

AREA_M2 = 20e-6
FLAT = SpecimenConfig(width_mm=10.0, thickness_mm=2.0)


def kept(truth: Truth, lag: float = 0.0, tared_at: float | None = None) -> tuple[History, LoadLog]:
    """A run whose mean strains and loads follow a curve, the load ``lag`` late, tared once in mid-test."""
    curve, history, loads = noisy(truth, 1), History(), LoadLog()
    assert curve.transverse is not None
    one = make_measurement(0).time_step
    for t, axial, across in zip(curve.t, curve.strain, curve.transverse, strict=True):
        history.add(replace(one, t=START + t, eyy=axial, exx=across, extension_y=axial, extension_x=across))
    true = truth.curve
    zero = 0.0
    for t in np.arange(0, true.t[-1] + 0.5, 1 / 80):
        force = AREA_M2 * float(np.interp(t - lag, true.t, true.stress))
        if tared_at is not None and not zero and t >= tared_at:
            zero = force
            loads.take_event(Event(START + t, EventKind.TARE, "a cell", "", "info", {"step_N": zero}))
        loads.append(LoadSample(START + t, force - zero))
    return history, loads


def test_a_tare_in_mid_test_falsifies_no_figure() -> None:
    truth = ramberg_osgood()
    plain, tared = (
        evaluate(*kept(truth, tared_at=at), FLAT) for at in (None, 0.3 * float(truth.curve.t[-1]))
    )
    for name in ("E", "Rm"):
        assert getattr(tared, name).value == pytest.approx(getattr(plain, name).value, rel=2e-3)
    run_state = RunState(EventLog(), FrameCounts(), *reversed(kept(truth, tared_at=1.0)))
    assert any(
        re.match(r"tared in mid-test by \d[\d. ]* k?N: ", line)
        for line in summary_lines(run_state, finished(run_state, FLAT))
    )
    run_state = RunState(EventLog(), FrameCounts(), *reversed(kept(truth)))
    assert not any("tared" in line for line in summary_lines(run_state, finished(run_state, FLAT)))


def test_a_metal_by_its_standard() -> None:
    history, loads = kept(ramberg_osgood())
    lines = figure_lines(evaluate(history, loads, FLAT), FLAT)
    assert lines[0].startswith("E = ") and "GPa  nu = 0.3" in lines[0]
    assert "Rp0.2 = 249.8" in lines[1] and "Rm = " in lines[1]
    text = "\n".join(lines)
    assert "iso6892: strains" in text and "counts as measured" in text
    assert "within range 2" in text
    assert "not known: ReH, ReL (no yield point" in text


def test_the_interval_of_e_names_the_limits_in_it() -> None:
    history, loads = kept(ramberg_osgood())
    assert "interval of the scatter alone)" in figure_lines(evaluate(history, loads, FLAT), FLAT)[0]
    stated = replace(FLAT, force_error_percent=1.0, strain_error_um_m=200.0)
    figures = evaluate(history, loads, stated)
    assert "interval, of E with limits of load cell, strain)" in figure_lines(figures, stated)[0]
    *rows, combined = budget_of(figures, CameraView(), stresses=True)
    optics = ["motion off the plane", "lens", "blur", "rolling shutter"]
    assert [row.cause for row in rows] == ["scatter", "load cell", "section", "strain", *optics]
    assert figures.span is not None
    assert rows[1].modulus == pytest.approx(0.01 / 3**0.5 * figures.E.value)
    assert rows[1].strain == pytest.approx(0.01 / 3**0.5 * figures.span.strain[1])
    assert math.isnan(rows[2].modulus)
    assert rows[2].words == "not stated: specimen.section_error_percent"
    heads, first, *_ = budget_cells([*rows, combined], "GPa", 1e9)
    share = figures.budget["scatter"]
    numbers = share * figures.span.strain[1] * 1e6, share * 100, share * figures.E.value / 1e9
    assert heads == ("", "µm/m", "% of E", "GPa") and first[0] == "scatter"
    assert [float(cell) for cell in first[1:]] == pytest.approx(numbers, rel=5e-3)
    assert combined.modulus == pytest.approx(
        math.hypot(*(row.modulus for row in (rows[0], rows[1], rows[3])))
    )
    assert figures.E.high - figures.E.value == pytest.approx(1.96 * combined.modulus, rel=1e-2)
    forces = replace(stated, width_mm=None, thickness_mm=None, section_error_percent=1.0)
    found = budget_of(evaluate(history, loads, forces), CameraView(), stresses=False)
    assert [row.cause for row in found] == ["scatter", "load cell", "strain", *optics, "combined"]


@pytest.mark.parametrize(
    ("view", "stated", "words"),
    [
        (CameraView(), False, "not stated: scale.stand_off_mm"),
        (CameraView(500.0), False, "not counted: 0.1 mm at 500 mm is 200 µm/m"),
        (CameraView(500.0), True, "in strain"),
        (CameraView(500.0, plates=True), True, "removed by plates; their noise is in scatter"),
        (CameraView(500.0, both_sides=True), False, "not in the mean of both sides"),
    ],
)
def test_what_the_budget_says_of_motion_off_the_plane(view: CameraView, stated: bool, words: str) -> None:
    shares = {"scatter": 0.003} | ({"strain": 0.004} if stated else {})
    rows = {row.cause: row for row in budget_rows(shares, 1e-3, 70.0, view, stresses=True)}
    assert rows["motion off the plane"].words == words
    assert rows["combined"].modulus == pytest.approx(70 * (0.005 if stated else 0.003))
    assert rows["combined"].strain == pytest.approx(5e-6 if stated else 3e-6)


def test_a_blur_that_came_with_the_load_is_counted_and_else_named() -> None:
    view = CameraView(sharpness="no change with the load")
    rows = budget_rows({"scatter": 3e-3, "blur": 4e-3}, 1e-3, 70.0, view, stresses=True)
    assert [row.strain for row in rows if row.cause == "blur"] == [pytest.approx(4e-6)]
    assert rows[-1].modulus == pytest.approx(0.35)
    rows = budget_rows({"scatter": 3e-3}, 1e-3, 70.0, view, stresses=True)
    assert [row.words for row in rows if row.cause == "blur"] == ["no change with the load"]


def test_the_budget_names_the_shutter() -> None:
    for readout, words in ((None, "not stated: camera.readout_ms"), (0.0, "none"), (33.0, "removed")):
        rows = budget_rows({"scatter": 0.1}, 1e-3, 1.0, CameraView(readout_ms=readout), stresses=False)
        assert next(row.words for row in rows if row.cause == "rolling shutter") == words


def test_a_figure_is_told_with_the_larger_half_of_its_interval() -> None:
    figure = Figure(2000.0, 1900.0, 2020.0)
    assert figure_text(figure) == "2\u202f000 ± 100"
    assert figure_text(figure, 1e3, "kN") == "2.00 ± 0.10 kN"


def test_without_a_force_there_is_no_line() -> None:
    history, _ = kept(ramberg_osgood())
    assert figure_lines(evaluate(history, LoadLog(), FLAT), FLAT) == []


def test_a_laminate_has_no_proof_strength() -> None:
    specimen = replace(FLAT, standard="astm-d3039", gauge_length_mm=50.0)
    history, loads = kept(composite())
    text = "\n".join(figure_lines(evaluate(history, loads, specimen), specimen))
    assert "Rp0.2" not in text
    assert "At = 1.19" in text and "(gauge length 50 mm, elongation " in text
    assert "elongation 0.5999 ± " in text and " mm at break)" in text


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"standard": "free", "modulus_between": (0.0002, 0.001)}, "free: strains 0.02"),
        ({"zero": "toe"}, "toe compensation"),
        ({"zero": "preload", "preload_MPa": 20.0}, "first reached the preload"),
    ],
)
def test_interval_and_zero_are_options(settings: dict, message: str) -> None:
    specimen = replace(FLAT, **settings)
    history, loads = kept(ramberg_osgood())
    assert message in "\n".join(figure_lines(evaluate(history, loads, specimen), specimen))


def test_without_a_section_forces_stand_for_stresses() -> None:
    history, loads = kept(ramberg_osgood())
    specimen = SpecimenConfig(zero="preload")
    lines = elastic_lines(evaluate(history, loads, specimen), specimen)
    assert lines[0].startswith("EA = 1") and " kN  nu = " in lines[0]
    assert "Fp0.2 = " in lines[1] and "Fm = " in lines[1]


def test_the_lag_of_the_load_is_told() -> None:
    history, loads = kept(ramberg_osgood(), lag=0.15)
    (line,) = lag_line(history, loads, FLAT)
    found = float(line.split(": ")[1].split(" ±")[0])
    assert abs(found - 150) < 40
    assert lag_line(history, LoadLog(), FLAT) == []
    (refused,) = lag_line(History(), loads, FLAT)
    assert "not known (0 frames have a strain" in refused


def test_forces_of_pictures_have_no_lag() -> None:
    history, loads = kept(ramberg_osgood(), lag=0.15)
    given = LoadLog(by_name=True)
    given.extend(*loads.arrays())
    assert lag_line(history, given, FLAT) == []
    assert lag_of(history, given, FLAT).why == "each force was given for a picture: there is none"


def test_a_bound_is_shown_as_one_and_is_in_no_mean() -> None:
    strength = Figure(62.5e6, 62.4e6, 62.6e6).at_least()
    figures = replace(evaluate(*kept(ramberg_osgood()), FLAT), Rm=strength, notes=("no force is known",))
    row = tensile_table(figures, stresses=True)["Rm"]
    assert row.text == "at least 62.5 MPa" and row.figure.low == pytest.approx(62.4)
    lines = figure_lines(figures, FLAT)
    assert any("Rm = at least 62.5 MPa" in line for line in lines) and "no force is known" in lines
    assert summary_of_rows([row, row])[2] == 0


def test_the_kinds_of_a_test_are_those_of_the_evaluation() -> None:
    for kind in KINDS:
        config = load_config(None, {"specimen.test": kind})
        assert tensile_options(config.specimen).test == kind
    with pytest.raises(ConfigError, match="'auto', 'tensile'"):
        load_config(None, {"specimen.test": "bend"})


def test_the_direction_of_the_load_is_told() -> None:
    history, loads = kept(ramberg_osgood())
    assert "off y (clockwise); y was found" in alignment_line(history, FLAT)[0]
    assert alignment_line(history, replace(FLAT, axis="y"))[0].endswith("off y (clockwise)")
    assert "is specimen.axis = 'x' right?" in alignment_line(history, replace(FLAT, axis="x"))[0]
    assert alignment_line(History(), FLAT) == []
    run_state = RunState(EventLog(), FrameCounts(), loads, history)
    assert any("off y" in line for line in summary_lines(run_state, finished(run_state, FLAT)))


def test_the_axis_is_found_where_it_is_not_given() -> None:
    history, loads = kept(ramberg_osgood())
    turned = History()
    for i in history.time_steps:
        turned.add(replace(i, exx=i.eyy, eyy=i.exx, extension_x=i.extension_y, extension_y=i.extension_x))
    assert "off x (clockwise); x was found" in alignment_line(turned, FLAT)[0]
    upright, lying = (figure_lines(evaluate(h, loads, FLAT), FLAT) for h in (history, turned))
    assert "along y" in "".join(upright) and "exx of the region" in lying[0]
    assert upright == [line.replace("exx of", "eyy of").replace("along x", "along y") for line in lying]
    given = replace(FLAT, axis="y")
    assert figure_lines(evaluate(turned, loads, given), given) != lying


def test_any_section_gives_an_area() -> None:
    assert FLAT.area_m2 == pytest.approx(AREA_M2)
    assert SpecimenConfig(diameter_mm=10.0).area_m2 == pytest.approx(np.pi / 4 * 1e-4)
    assert SpecimenConfig(area_mm2=7.0, width_mm=1.0, thickness_mm=1.0).area_m2 == pytest.approx(7e-6)
    assert SpecimenConfig(width_mm=1.0).area_m2 is None


def test_noise_and_latency_of_a_run_are_the_usual_ones_in_the_units_of_the_line() -> None:
    """Medians: one burst that took long, or was noisy, is not the noise of the run."""
    history, one = History(), make_measurement(0).time_step
    for k in range(21):
        odd = 50.0 if k == 20 else 1.0
        history.add(
            replace(
                one, noise_GL=2.5 * odd, zoi_sigma=30e-6 * odd, sigma_eyy=4e-6 * odd, latency_s=0.04 + 1e-3 * k,
                measure_s=12e-3 * odd,
            )
        )  # fmt: skip
    assert noise_line(history) == (
        "noise: one frame 2.5 GL, strain of one ZOI 30 µm/m, of the region 4 µm/m (predicted, 1 sigma)"
    )
    assert latency_lines(history) == [
        "latency from the last frame of a burst: p50 50 ms, p95 59 ms, largest 60 ms; the kernel took 12.0 ms"
    ]
    replayed = History()
    replayed.add(replace(one, latency_s=math.nan))
    assert latency_lines(replayed) == []


def test_the_options_of_an_evaluation_are_in_si_units() -> None:
    """Errors in % and um/m, a preload in MPa; without a section neither its error nor a preload counts."""
    given: dict[str, Any] = {
        "zero": "preload", "preload_MPa": 2.5, "force_error_percent": 0.5, "section_error_percent": 2.0,
        "strain_error_um_m": 30.0,
    }  # fmt: skip
    options = tensile_options(replace(FLAT, **given))
    assert (options.zero, options.preload) == ("preload", 2.5e6)
    assert astuple(options.limits) == (0.005, 0.02, pytest.approx(30e-6), None)
    options = tensile_options(SpecimenConfig(**given))
    assert options.zero == "raw" and options.limits.section is None
    assert tensile_options(replace(FLAT, zero="toe")).zero == "toe"
    assert astuple(tensile_options(FLAT).limits) == (None, None, None, None)


def test_the_sharpness_has_the_largest_change_and_the_last() -> None:
    blur, sigma = [0.1, -0.4, math.nan, 0.25], [0.02, 0.03, 0.01, 0.04]
    assert sharpness_line(blur, sigma) == [
        "sharpness since the reference: sharper by 0.40 ± 0.03 px at most, less sharp by 0.25 ± 0.04 px in the last"
        " picture"
    ]
    assert sharpness_line([math.nan], [0.1]) == []


@pytest.mark.parametrize(
    ("lag", "corrected", "how"),
    [(0.0321, 0.0, "not applied; --lag 0.032 does"), (-0.0321, 0.0, "not applied; --lag -0.032 does"),
     (0.004, 0.0, "too small to matter"), (0.0321, 0.05, "50 ms corrected")],
)  # fmt: skip
def test_the_lag_that_is_advised_is_the_one_found(
    monkeypatch: pytest.MonkeyPatch, lag: float, corrected: float, how: str
) -> None:
    history, loads = History("y"), LoadLog(lag_s=corrected)
    history.add(make_measurement(0).time_step)
    loads.append(LoadSample(START, 5.0))
    monkeypatch.setattr(
        "live.results.stored_fields.find_lag", lambda *_: Figure(lag, lag - 0.001, lag + 0.001)
    )
    (line,) = lag_line(history, loads, FLAT)
    assert in_ascii(line) == f"lag of the load behind the frames: {1e3 * lag:.1f} +- 1.0 ms (95%; {how})"
