"""The arithmetic of the experiments on data whose result is known; how results are kept, shown and judged."""

from __future__ import annotations

import csv
import io
import math
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquire.errors import ConfigError, DataError
from live.setup.pattern.imposed import ExpectedErrors, Imposed, robust_std
from live.setup.pattern.outcome import (
    ExperimentContext,
    ExperimentOutcome,
    ResultTable,
    figure,
    save_figure,
    shown,
    write_outcome,
)
from live.setup.pattern.own_pattern import recommended
from tests.paper.outcomes import Comparison, compared, read_outcome, verdict
from tests.paper.peers import GAUGE, dense_flow, plane_strain, pyramid_flow
from tests.paper.resolution import autocorrelation, fitted_length, half_width
from tests.paper.section41 import derived, low_pass_for
from tests.paper.table2_design import CORNERS, PAPER, corner_values, fitted, model_matrix


def test_the_papers_model_at_its_optimum_and_its_negative_corners() -> None:
    """51 um/m where the text gives 58, and negative uncertainties at 7 of 16 corners (coded -1, 1)."""
    predicted = {corner_values(c): float(model_matrix(np.array([c]))[0] @ np.array(PAPER)) for c in CORNERS}
    assert predicted[64, 2.0, 16, 0.0] == pytest.approx(51e-4, rel=0.01)  # % strain
    assert sum(value < 0 for value in predicted.values()) == 7


def test_a_model_is_found_again_with_its_confidence() -> None:
    rng = np.random.default_rng(2)
    corners = np.repeat(np.array(CORNERS), 5, axis=0)
    beta = np.array([1.0, -0.5, 0.3, 0.0, 0.8, 0, 0, 0.2, 0, 0, 0])
    response = model_matrix(corners) @ beta + 0.05 * rng.standard_normal(len(corners))
    fit = fitted(corners, response)
    assert np.all(np.abs(fit.beta - beta) < 5 * fit.sigma)
    assert fit.sigma == pytest.approx(0.05 / math.sqrt(80), rel=0.3)
    assert np.all(fit.confidence[beta != 0] > 99)
    assert np.median(fit.confidence[beta == 0]) < 95


def test_refused_corners_are_left_out() -> None:
    corners = np.repeat(np.array(CORNERS), 3, axis=0)
    beta = np.arange(11.0) / 10
    response = model_matrix(corners) @ beta
    response[:3] = np.nan
    assert fitted(corners, response).beta == pytest.approx(beta)


def test_autocorrelation_width_of_filtered_noise() -> None:
    from scipy.ndimage import gaussian_filter

    noise = gaussian_filter(np.random.default_rng(1).standard_normal((400, 400)), 5.0, mode="wrap")
    # A Gaussian of sigma s has an autocorrelation of sigma s sqrt(2).
    expected = math.sqrt(2 * math.log(2)) * 5 * math.sqrt(2)
    assert half_width(autocorrelation(noise), 1) == pytest.approx(expected, rel=0.1)
    assert half_width(autocorrelation(noise), 3) == pytest.approx(3 * expected, rel=0.1)
    assert math.isnan(half_width(np.ones(5), 1))


def test_length_of_known_losses() -> None:
    periods = np.array([64.0, 96, 128, 256])
    length, gain = fitted_length(periods, 0.92 * np.exp(-((30 / periods) ** 2)))
    assert length == pytest.approx(30 / math.sqrt(-math.log(0.9)))
    assert gain == pytest.approx(0.92)
    assert math.isnan(fitted_length(periods, np.zeros(4))[0])


def test_classical_derivation() -> None:
    x = 8.0 * np.arange(40)
    ramp = np.tile(1e-3 * x, (20, 1))
    assert derived(ramp, 8, 6.0)[5:-5, 5:-5] == pytest.approx(1e-3)
    wave = np.tile(np.sin(2 * np.pi * x / 128), (20, 1))
    low_pass = low_pass_for(10.0, 6.0, 8)
    kept = derived(wave, 8, low_pass)[10, 8:-8] / (2 * np.pi / 128 * np.cos(2 * np.pi * x / 128))[8:-8]
    assert np.median(kept) == pytest.approx(math.exp(-2 * np.pi**2 * (100 - 36) / 128**2), rel=0.02)
    assert low_pass_for(5.0, 6.0, 8) == 0


def test_plane_of_a_gauge() -> None:
    x, y = np.meshgrid(8.0 * np.arange(20), 8.0 * np.arange(15))
    found = plane_strain(1e-3 * x - 4e-3 * y, 8)
    assert found == pytest.approx(np.full(found.shape, 1e-3))
    assert GAUGE == 5


@pytest.mark.parametrize("flow", [pyramid_flow, dense_flow])
def test_peers_see_the_same_displacement(flow: object) -> None:
    from hw_mocks.deformation import Affine
    from tests.paper.truth import SensorModel, TrueScene

    pair = TrueScene((160, 160), 2.5, seed=3).pair(Affine(0.3, -0.2), SensorModel(8))
    points = np.array([[60.0, 60.0], [80, 90], [100, 70]])
    found = flow(*pair, points)  # type: ignore[operator]
    assert found == pytest.approx(np.tile([0.3, -0.2], (3, 1)), abs=0.06)


def test_imposed_deformation_is_what_it_says() -> None:
    y, x = np.mgrid[:96, :128].astype(float)
    picture = 100 + 40 * np.sin(2 * np.pi * x / 16) * np.cos(2 * np.pi * y / 20)
    imposed = Imposed(picture, 0.3, 255.0)
    inner = np.s_[20:-20, 20:-20]
    for u, strain in ((0.4, 0.0), (0.0, 1e-2)):
        back = 63.5 + (x - 63.5 - u) / (1 + strain)
        truth = 100 + 40 * np.sin(2 * np.pi * back / 16) * np.cos(2 * np.pi * y / 20)
        # The Wiener filter takes a little of a pattern that is two lines of its spectrum.
        assert np.max(np.abs(imposed.deformed(u, strain) - truth)[inner]) < 1.5
    noisy = Imposed(picture, 2.0, 255.0)
    assert np.std(noisy.burst(noisy.light, 4) - noisy.light) == pytest.approx(1.0, rel=0.05)


def test_a_few_odd_zois_do_not_count() -> None:
    values = 2.0 + 0.1 * np.random.default_rng(0).standard_normal(2000)
    values[:50] = 1e3
    values[50:60] = np.nan
    assert robust_std(values) == pytest.approx(0.1, rel=0.1)
    assert math.isnan(robust_std(np.full(3, np.nan)))


def expectation(size: int, n: int, sigma: float) -> ExpectedErrors:
    return ExpectedErrors(size, 1, n, 100, 0, 0, sigma, 0, sigma, sigma, 0, 2.28 * size, 0)


def test_the_smallest_zoi_that_reaches_the_target_is_recommended() -> None:
    cases = [
        expectation(32, 1, 4e-4),
        expectation(64, 1, 9e-5),
        expectation(96, 1, 4e-5),
        expectation(32, 16, 1e-4),
    ]
    text = recommended(cases, 1e-4, None)
    assert "1 frame averaged: ZOI 64 px, step 16 px" in text
    assert "16 frames averaged: ZOI 32 px" in text
    assert "not reached" in recommended(cases, 1e-6, None)


@pytest.mark.slow
def test_the_simulated_weave_is_measured_better_than_by_the_paper(tmp_path: Path) -> None:
    from live.setup.pattern.outcome import ExperimentContext
    from tests.paper.woven import woven

    outcome = woven(ExperimentContext(tmp_path, quick=True))
    (table,) = outcome.tables
    figures = {row[0]: dict(zip(table.columns, row, strict=True)) for row in table.rows}
    strain = figures["rms error of exx, um/m"]
    # Window attenuation of a 160 px cell and 5 GL of noise leave about 70 um/m.
    assert strain["ours, 64 px"] < 110
    assert strain["ours, 64 px"] < 0.7 * strain["the latter, filtered as in the paper"]
    assert (tmp_path / "fig7_woven.png").exists()
    assert f"]({outcome.figures[0]})" in outcome.text


def test_the_limit_of_a_burst_falls_with_the_root_of_its_frames() -> None:
    from tests.paper.burst import BurstStudy
    from tests.paper.truth import SensorModel

    study, noisy = BurstStudy(quick=True), SensorModel(12, 4.0)
    one = study.predicted(noisy, 1)
    assert one == pytest.approx(study.unit * noisy.sigma / 4095) and one > 0
    assert study.predicted(noisy, 16) == pytest.approx(one / 4)


@pytest.mark.slow
def test_averaging_falls_as_predicted_until_rounding_stops_it(monkeypatch: pytest.MonkeyPatch) -> None:
    import tests.paper.burst as burst
    from tests.paper.truth import SensorModel

    monkeypatch.setattr(burst, "LENGTHS", (1, 16))
    study = burst.BurstStudy(quick=True)
    ratios = {}
    for noise in (0.1, 4.0):
        camera = SensorModel(12, noise)
        for n, reference, current in study.bursts(camera):
            std, _ = study.scatter(reference, current, camera.sigma / math.sqrt(n))
            ratios[noise, n] = std / study.predicted(camera, n)
    assert ratios[4.0, 1] == pytest.approx(1, abs=0.25)
    assert ratios[4.0, 16] == pytest.approx(1, abs=0.25)
    assert ratios[0.1, 16] > 2  # every frame rounds alike


TABLE = ResultTable("numbers", ("name", "length px"), (("a", 1.5), ("b, c", float("nan")), ("d", 3)))
OUTCOME = ExperimentOutcome(
    "name", "Title", "text ![x](p.png)", (TABLE,), (), (Comparison("s", "the paper", "better"),), 2.5
)


def test_csv_keeps_every_digit() -> None:
    table = ResultTable("t", ("x px",), ((0.1 + 0.2,), (1e-17,)))
    rows = list(csv.reader(io.StringIO(table.csv())))
    assert rows[0] == ["x px"]
    assert [float(row[0]) for row in rows[1:]] == [0.1 + 0.2, 1e-17]


def test_markdown_is_a_table() -> None:
    lines = TABLE.markdown().splitlines()
    assert lines[0] == "| name | length px |"
    assert lines[2] == "| a | 1.50 |"
    assert lines[3] == "| b, c | - |"
    assert len({line.count("|") for line in lines}) == 1


@given(st.floats(1e-12, 1e12))
def test_shown_keeps_three_digits(value: float) -> None:
    assert float(shown(value)) == pytest.approx(value, rel=0.006)


def test_what_is_not_a_number_is_shown_as_it_is() -> None:
    assert (shown("x"), shown(7), shown(0.0), shown(float("nan"))) == ("x", "7", "0", "-")


@pytest.mark.parametrize(
    ("ours", "word"), [(0.5, "better"), (0.95, "equal"), (1.05, "equal"), (1.2, "worse")]
)
def test_verdicts(ours: float, word: str) -> None:
    assert compared(ours, 1.0) == word
    found = verdict("noise", "px", ours, 1.0, "a peer")
    assert found.word == word
    assert shown(ours) in found.subject


def test_an_outcome_survives_the_disk(tmp_path: Path) -> None:
    write_outcome(OUTCOME, tmp_path, "key")
    again = read_outcome("name", tmp_path, "key")
    assert again is not None
    assert (again.text, again.verdicts, again.seconds) == (OUTCOME.text, OUTCOME.verdicts, 2.5)
    assert again.tables[0].rows[0] == ("a", 1.5)
    assert math.isnan(again.tables[0].rows[1][1])
    assert (tmp_path / "numbers.csv").read_text(encoding="utf-8") == TABLE.csv()


def test_what_does_not_serve_is_not_taken(tmp_path: Path) -> None:
    assert read_outcome("name", tmp_path, "key") is None
    write_outcome(OUTCOME, tmp_path, "key")
    assert read_outcome("name", tmp_path, "another key") is None
    with_figure = ExperimentOutcome("name", "t", "", figures=("gone.png",))
    write_outcome(with_figure, tmp_path, "key")
    assert read_outcome("name", tmp_path, "key") is None


@pytest.mark.parametrize("text", ["", "{", "[]", '{"format": 1, "key": "key", "outcome": {}}'])
def test_a_damaged_file_is_named(tmp_path: Path, text: str) -> None:
    (tmp_path / "name.json").write_text(text, encoding="utf-8")
    with pytest.raises(DataError, match=r"name\.json"):
        read_outcome("name", tmp_path, "key")


def test_without_matplotlib_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    with pytest.raises(ConfigError, match=r"pip install phasedic\[plots\]"):
        figure()


def test_a_figure_is_written(tmp_path: Path) -> None:
    drawn = figure(2, 1)
    drawn.subplots().plot([0, 1], [1, 0])
    assert save_figure(ExperimentContext(tmp_path), "a.png", drawn) == "a.png"
    assert (tmp_path / "a.png").read_bytes()[:4] == b"\x89PNG"


def test_steps_tick(tmp_path: Path) -> None:
    shares: list[float] = []
    assert list(ExperimentContext(tmp_path, tick=shares.append).steps("abcd")) == list("abcd")
    assert shares == [0.25, 0.5, 0.75, 1.0]
