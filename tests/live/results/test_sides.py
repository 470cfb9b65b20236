"""Front and back of one test put together: strains, E, and the channels of a running test."""

from __future__ import annotations

import csv
import html
import io
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from acquire.errors import DataError
from analysis.evaluate import Curve, GaugeValue, TensileOptions, TwoSides, evaluate_test
from live.cli import main
from live.config.sections import SpecimenConfig
from live.pipeline.run_state import RunState
from live.results import sides as clocks
from live.results.figures import tensile_options
from live.results.report.several import _strains, _stress_strain, report_of_cameras
from live.results.run_folder import open_run
from live.results.sides import (
    JointChannels,
    SideOfTest,
    SidesOfTest,
    _at_the_front,
    _mean_of,
    cameras_in,
    longest_gap,
    newest,
    recorded_cameras_in,
    shift_s,
    write_sides,
)
from tests.live import made_run
from tests.live.made_run import CONFIG, GAUGES, PULLED, force_of, make_run, noisy
from tests.live.made_up import START, make_measurement

BENT, TOWARDS = 0.05, -0.08  # bending and out-of-plane motion of the front, as shares of the strain
LATER_S = 0.73  # the back was started so much later


def runs(
    folder: Path, monkeypatch: pytest.MonkeyPatch, config: Mapping[str, Any] = CONFIG
) -> tuple[Path, Path]:
    """Two runs of one test; the times of the back count from its own start."""
    wrong = BENT + TOWARDS
    front = make_run(folder / "front", config=config, field_of=lambda k, e: noisy(k, e * (1 + wrong)))
    monkeypatch.setattr(made_run, "START", made_run.START + LATER_S)
    back = make_run(folder / "back", config=config, field_of=lambda k, e: noisy(k + 1000, e * (1 - wrong)))
    return front, back


def test_a_gap_is_five_times_the_usual_distance_of_instants() -> None:
    assert longest_gap(np.array([0.0, 0.2, 0.4, 0.6, 9.0])) == pytest.approx(1.0)
    assert longest_gap(np.zeros(1)) == 0.0


def test_the_curve_of_the_mean_has_means_and_the_stress_of_the_front() -> None:
    """The errors of two lenses are independent: half of their root sum of squares is in the mean."""
    t, ones = np.arange(60) / 10, np.ones(60)

    def side(strain: float, lens: float, stress: float) -> SideOfTest:
        curve = Curve(t, strain * t, stress * t, -strain * t / 4, narrowing=-strain * t, lens=lens * ones)
        return SideOfTest({}, curve, stress * t)

    front, back = side(1e-3, 3e-5, 7e7), side(3e-3, 4e-5, 9e7)
    sides = SidesOfTest.of(front, back, TensileOptions())
    assert [one.Rm.value for one in sides.figures.values()] == pytest.approx([7e7 * t[-1]] * 3)
    found = sides.curve
    assert found.transverse is not None and found.narrowing is not None and found.lens is not None
    np.testing.assert_allclose(found.strain, 2e-3 * t)
    np.testing.assert_allclose(found.stress, 7e7 * t)
    np.testing.assert_allclose(found.transverse, -5e-4 * t)
    np.testing.assert_allclose(found.narrowing, -2e-3 * t)
    np.testing.assert_allclose(found.lens, 2.5e-5)


def test_the_mean_has_neither_bending_nor_motion(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    config = {**CONFIG, "gauges": GAUGES}
    with open_run(
        make_run(tmp_path / "truth", config=config, field_of=lambda k, e: noisy(k, e, 0.0, 1e-5))
    ) as run:
        truth, E = run.gauges["axial"].value, evaluate_test(run.curve, tensile_options(run.specimen)).E.value
    front, back = runs(tmp_path, monkeypatch, config)
    with open_run(front) as one, open_run(back) as other:
        assert other.start_monotonic - one.start_monotonic == pytest.approx(LATER_S)
        sides = SidesOfTest.of_folders(one, other)
    axial = sides.courses["axial"]
    for values, share in ((axial.mean, 1.0), (axial.bending, BENT + TOWARDS)):
        rest = values - share * truth
        assert np.mean(np.abs(rest) < 3 * axial.sigma) > 0.95
        assert abs(np.mean(rest)) < 1e-6
    assert abs(sides.figures["front"].E.value / E - 1) > 0.025
    assert sides.figures["both"].E.value == pytest.approx(E, rel=1e-3)
    assert sides.figures["both"].E.low < E < sides.figures["both"].E.high


@pytest.mark.slow
def test_the_command_writes_a_table(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    front, back = runs(tmp_path, monkeypatch, {**CONFIG, "gauges": GAUGES})
    assert main(["sides", str(front), str(back)]) == 0
    shown = capsys.readouterr().out
    assert "both:   E = " in shown and "front:  E = " in shown and "back:   E = " in shown
    with (front / "sides.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(PULLED)
    assert float(rows[-1]["mean_axial"]) == pytest.approx(PULLED[-1], rel=0.02)  # of a coarse grid
    assert float(rows[-1]["bending_axial"]) == pytest.approx((BENT + TOWARDS) * PULLED[-1], rel=0.02)
    assert abs(float(rows[-1]["mean_shear"])) < 1e-5
    assert main(["sides", str(front), str(back)]) == 2  # it exists
    assert "sides.csv" in capsys.readouterr().err


STRAIN, BENDING = 1e-3, 2e-4


def side(strain: float, numbers: Sequence[int]) -> RunState:
    state = RunState.new(1.0)
    measure(state, strain, numbers)
    return state


def measure(state: RunState, strain: float, numbers: Sequence[int]) -> None:
    for number in numbers:
        state.history.add(make_measurement(number, strain).time_step)


def both(front: RunState, back: RunState) -> JointChannels:
    joint = JointChannels()
    joint.attach({"front": front, "back": back}, live=True)
    return joint


def test_mean_bending_and_sigma_at_the_newest_instant_of_both() -> None:
    front, back = side(STRAIN + BENDING, range(9)), side(STRAIN - BENDING, range(8))
    found = both(front, back).read(START)
    assert found["mean_time_s"] == pytest.approx(0.7)  # the back is not so far yet
    assert found["mean_axial"] == pytest.approx(STRAIN)
    assert found["bending_axial"] == pytest.approx(BENDING)
    assert 0 < found["sigma_mean_axial"] < 1e-5


def test_nothing_before_both_have_measured() -> None:
    assert JointChannels().read(START) == {}
    waiting = both(side(STRAIN, range(40)), side(STRAIN, ()))
    assert (waiting.read(START), waiting.lost) == ({}, "")


@pytest.mark.parametrize("late", ["front", "back"])
def test_a_side_that_stalls_leaves_no_value(late: str) -> None:
    states = {"front": side(STRAIN, range(8)), "back": side(STRAIN, range(8))}
    joint = both(**states)
    goes_on = states["back" if late == "front" else "front"]
    measure(goes_on, STRAIN, range(8, 18))
    assert joint.lost == "" and joint.read(START)["mean_time_s"] == pytest.approx(0.7)
    measure(goes_on, STRAIN, range(18, 21))
    assert (joint.read(START), joint.lost) == ({}, f"the {late} gives no strains")
    measure(states[late], STRAIN, range(21, 24))
    measure(goes_on, STRAIN, range(21, 24))
    assert joint.lost == "" and joint.read(START)["mean_time_s"] == pytest.approx(2.3)


def test_strains_that_one_side_has_no_more() -> None:
    front, back = side(STRAIN, range(8)), side(STRAIN, range(8))
    joint = both(front, back)
    for number in range(8, 25):
        measure(front, STRAIN, [number])
        measure(back, float("nan"), [number])
        assert number > 17 or not joint.lost
    assert (joint.read(START), joint.lost) == ({}, "no strain of both for 1.7 s")


def test_a_pause_of_both_is_no_loss() -> None:
    front, back = side(STRAIN, range(8)), side(STRAIN, range(8))
    joint = both(front, back)
    measure(front, STRAIN, range(1000, 1003))
    assert joint.lost == ""
    measure(back, STRAIN, range(1000, 1003))
    assert joint.lost == "" and joint.read(START)["mean_time_s"] == pytest.approx(100.2)


@pytest.mark.parametrize("failed", ["front", "back"])
def test_a_camera_that_fails_leaves_no_value_at_once(failed: str) -> None:
    states = {"front": side(STRAIN, range(8)), "back": side(STRAIN, range(8))}
    joint = both(**states)
    states[failed].health.camera_failed = True
    assert (joint.read(START), joint.lost) == ({}, f"the camera of the {failed} has failed")


def test_two_cameras_that_stall_together_leave_no_value() -> None:
    now = [START + 0.8]
    states = {name: side(STRAIN, range(8)) for name in ("front", "back")}
    joint = JointChannels(lambda: now[0])
    joint.attach(states, live=True)
    for state in states.values():
        state.health.state = "REC"
    assert joint.lost == "" and joint.read(START)["mean_axial"] == pytest.approx(STRAIN)
    now[0] = START + 3.0
    assert (joint.read(START), joint.lost) == ({}, "the front gives no strains")
    assert newest(states, now[0]) == {}
    for state in states.values():
        state.health.paused = True
    assert (joint.read(START), joint.lost) == ({}, "")


T = np.arange(5.0)


def curve(value: float, **more: Any) -> Curve:
    return Curve(T, value * T, 10 * value * T, -value * T / 4, elastic=2 * value * T, **more)


def test_the_errors_of_both_cameras_are_independent() -> None:
    """Of lenses and blurs; a blur that only one of them knows is none of the mean."""
    ones = np.ones(5)
    mean = _mean_of(curve(1.0, blur=3e-4 * ones, lens=3e-5 * ones), curve(3.0, blur=4e-4 * ones))
    assert mean.elastic is not None and mean.lens is not None and mean.blur is not None
    np.testing.assert_allclose(mean.elastic, 4.0 * T)
    np.testing.assert_allclose(mean.lens, 1.5e-5)
    np.testing.assert_allclose(mean.blur**2, math.hypot(9e-8, 16e-8) / 2)
    assert _mean_of(curve(1.0, blur=ones), curve(3.0)).blur is None
    assert mean.source.startswith("mean of both sides: ") and mean.narrowing is None


def test_the_back_is_moved_to_the_instants_of_the_front() -> None:
    moved = {name: 1.0 + np.arange(5.0) * k for k, name in enumerate(
        ("uneven", "misfit", "narrowing", "lens", "blur"), 2)}  # fmt: skip
    late = replace(curve(1.0, **moved), t=T + 0.5)
    found = _at_the_front(curve(2.0), late, 2.0)
    assert found.t is T and math.isnan(found.strain[0])
    np.testing.assert_allclose(found.strain[1:], T[1:] - 0.5)
    np.testing.assert_allclose(found.stress, 20 * T)
    assert found.transverse is not None and found.elastic is not None
    np.testing.assert_allclose(found.transverse[1:], -(T[1:] - 0.5) / 4)
    np.testing.assert_allclose(found.elastic[1:], 2 * (T[1:] - 0.5))
    for k, name in enumerate(moved, 2):
        np.testing.assert_allclose(getattr(found, name)[1:], 1 + k * (T[1:] - 0.5), err_msg=name)
    bare = _at_the_front(curve(2.0), Curve(T, T, T), 2.0)
    assert bare.transverse is None and bare.lens is None


def sides_of(axial: float, gauge: float = 3e-3) -> SidesOfTest:
    def two(mean: float) -> TwoSides:
        values = np.array([0.0, mean, math.nan])
        return TwoSides(np.array([0.0, 1.0, 2.0]), values, 0.1 * values, np.array([1e-6, 2e-6, math.nan]))

    return SimpleNamespace(  # type: ignore[return-value]
        courses={"axial": two(axial), "wide": two(gauge), "lost": two(math.nan)}, force=np.array([0.0, 5.0, 7.5]),
        curve=SimpleNamespace(stress=np.array([0.0, 2e8, 3e8])),
    )  # fmt: skip


def test_the_table_of_both_sides() -> None:
    file = io.StringIO()
    write_sides(sides_of(2e-3), file)
    heads, first, second, third = (line.split(",") for line in file.getvalue().splitlines())
    assert heads[:5] == ["time_s", "force_N", "mean_axial", "bending_axial", "sigma_axial"]
    assert first[:5] == ["0", "0", "0", "0", "1e-06"]
    assert second[:8] == ["1", "5", "0.002", "0.0002", "2e-06", "0.003", "0.0003", "2e-06"]
    assert third[:5] == ["2", "7.5", "", "", ""]


def test_the_last_strains_of_both_sides() -> None:
    shown = re.sub(r"\|+", "|", re.sub("<[^>]*>", "|", str(_strains(sides_of(2e-3)))))
    assert "|axial|2\u202f000.0|200.0|2.0|" in shown and "|wide|3\u202f000.0|300.0|2.0|" in shown
    assert "|lost|0.0|0.0|1.0|" in shown, "the last that is known"


def test_the_curves_of_mean_front_and_back() -> None:
    plot = _stress_strain(sides_of(2e-3), True)
    assert [line.label for line in plot.curves] == ["mean", "front", "back"]
    assert [line.x[1] for line in plot.curves] == pytest.approx([2000, 2200, 1800])
    assert [line.y[1] for line in plot.curves] == [200.0] * 3 and plot.y_label == "stress, MPa"
    forces = _stress_strain(sides_of(0.05), False)
    assert (forces.x_label, forces.y_label) == ("axial strain, %", "force, kN")
    assert forces.curves[0].x[1] == pytest.approx(5.0) and forces.curves[0].y[1] == pytest.approx(2e5)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A test whose front has too much strain, and whose back too little."""
    made, config = tmp_path_factory.mktemp("sides"), {**CONFIG, "gauges": GAUGES}
    for k, (side, share) in enumerate((("front", 1 + BENT), ("back", 1 - BENT))):
        make_run(made / side, config=config, session=False,
                 field_of=lambda n, e, k=k, share=share: noisy(n + 1000 * k, share * e))  # type: ignore[misc]  # fmt: skip
    return made


def test_the_report_of_both_sides(folder: Path) -> None:
    with open_run(folder / "front") as front, open_run(folder / "back") as back:
        made = report_of_cameras({"front": front, "back": back}, {"front": "front/report.html"})
        sides = SidesOfTest.of_folders(front, back)
        lines = list(sides.figure_lines(stresses=True))
    stress, mean, bending = made.figures
    assert [one.name for one in made.figures] == ["stress-strain", "mean-time", "bending-time"]
    assert mean.curves[0].y[-1] == pytest.approx(1e6 * PULLED[-1], rel=0.02)
    assert bending.curves[0].y[-1] == pytest.approx(1e6 * BENT * PULLED[-1], rel=0.05)
    assert mean.curves[0].sigma is not None and (mean.title, bending.title) == (
        "Mean of front and back", "Front minus mean",
    )  # fmt: skip
    assert stress.curves[0].y[-1] == pytest.approx(1e-6 * force_of(PULLED[-1]) / 20e-6, rel=1e-6)
    text = html.unescape(made.html)
    assert (
        "S1: front and back" in text
        and 'href="front/report.html"' in text
        and "report of the back" not in text
    )
    moduli = {
        row[0]: float(row[1]) for row in re.findall(r"<tr><td>(both|front|back)</td><td>([\d.]+) ±", text)
    }
    assert moduli["both"] == pytest.approx(70.0, rel=0.02)
    assert moduli["front"] == pytest.approx(70 / (1 + BENT), rel=0.02)
    assert moduli["back"] == pytest.approx(70 / (1 - BENT), rel=0.02)
    assert [line.split()[0] for line in lines] == ["both:", "front:", "back:"]
    assert "not in the mean of both sides" in text


def test_the_report_of_two_fields(folder: Path) -> None:
    with open_run(folder / "front") as one, open_run(folder / "back") as other:
        made = report_of_cameras({"first": one, "second": other}, {"second": "second/report.html"})
    (plot,) = made.figures
    assert [(line.label, line.colour) for line in plot.curves] == [("first", 0), ("second", 1)]
    assert [line.y[-1] for line in plot.curves] == pytest.approx(
        [1e6 * share * PULLED[-1] for share in (1 + BENT, 1 - BENT)], rel=0.02
    )
    np.testing.assert_allclose(plot.curves[1].x, 0.1 * np.arange(len(PULLED)), atol=1e-9)
    assert "Budget of E, second" in made.html and "S1: 2 fields of view" in made.html


def test_a_side_has_its_clock_and_its_gauges(folder: Path) -> None:
    with open_run(folder / "front") as run:
        side = SideOfTest.of_folder(run, 2.5)
        values = run.strain.values
    assert set(side.courses) == {"axial", "transverse", "shear"}
    np.testing.assert_allclose(side.courses["axial"].value, values["gauge_axial"])
    np.testing.assert_allclose(side.courses["transverse"].value, values["exx"])
    np.testing.assert_allclose(side.courses["transverse"].sigma, values["sigma_exx"])
    for course in side.courses.values():
        assert course.t[0] == 2.5
    assert side.curve.t[0] == 2.5
    np.testing.assert_allclose(side.force, [force_of(e) for e in PULLED], rtol=1e-6)


def state_of(values: list[tuple[float, float]], **more: Any) -> RunState:
    """Two steps with a gauge."""
    state = RunState.new(1.0)
    for number, (strain, gauge) in enumerate(values):
        step = make_measurement(number, strain).time_step
        gauges = {"wide": GaugeValue(gauge, 1e-6), **more}
        state.history.add(replace(step, gauges=gauges))
    return state


def test_gauges_of_a_running_test_are_put_together() -> None:
    states = {"front": state_of([(1e-3, 1e-3), (2e-3, 5e-3)]), "back": state_of([(1e-3, 1e-3), (1e-3, 3e-3)])}
    found = newest(states)
    assert found["wide"].mean == pytest.approx(4e-3) and found["wide"].bending == pytest.approx(1e-3)
    # Noise of both, and what one of them may be turned by 0.1 degree.
    assert found["wide"].sigma == pytest.approx(
        math.hypot(1e-6 / math.sqrt(2), 1.523e-6 / math.sqrt(3)), rel=1e-3
    )
    assert found["wide"].t == found["axial"].t == pytest.approx(START + 0.1)
    joint = JointChannels()
    joint.attach(states, live=False)
    shown = joint.read(START - 1)
    assert shown["mean_time_s"] == pytest.approx(1.1)
    assert shown["mean_gauge_wide"] == pytest.approx(4e-3) and shown["bending_gauge_wide"] == pytest.approx(
        1e-3
    )
    assert shown["mean_axial"] == pytest.approx(1.5e-3) and "mean_wide" not in shown


def test_a_gauge_named_axial_has_both_names() -> None:
    own = {"axial": GaugeValue(7e-3, 1e-6)}
    states = {side: state_of([(1e-3, 1e-3), (2e-3, 5e-3)], **own) for side in ("front", "back")}
    joint = JointChannels()
    joint.attach(states, live=True)
    shown = joint.read(START)
    assert shown["mean_axial"] == shown["mean_gauge_axial"] == pytest.approx(7e-3)
    side = SideOfTest.of_state(states["front"], SpecimenConfig())
    assert side.courses["wide"].value.tolist() == pytest.approx([1e-3, 5e-3])
    assert side.courses["wide"].sigma.tolist() == pytest.approx([1e-6, 1e-6])
    assert side.courses["wide"].t.tolist() == pytest.approx([START, START + 0.1])


def run_at(monotonic: float, utc: str, session: bool = True) -> Any:
    strain = SimpleNamespace(start_utc=f"2030-01-02T03:04:{utc}+00:00")
    return SimpleNamespace(session=session or None, start_monotonic=monotonic, strain=strain, path=Path(utc))


def test_the_clocks_of_two_runs() -> None:
    """That of the machine counts; the one of the day may have been set by two seconds."""
    assert shift_s(run_at(100.0, "05"), run_at(107.5, "12")) == 7.5
    assert shift_s(run_at(107.5, "12"), run_at(100.0, "05")) == -7.5
    assert shift_s(run_at(100.0, "05"), run_at(107.0, "10")) == 7.0 and clocks.CLOCKS_AGREE_S == 2.0
    with pytest.raises(DataError, match="their clocks are 3 s apart"):
        shift_s(run_at(100.0, "05"), run_at(108.0, "10"))
    assert shift_s(run_at(0.0, "05", False), run_at(0.0, "05", False)) == 0.0
    with pytest.raises(DataError, match="07: no recording, whose clock is needed"):
        shift_s(run_at(0.0, "05"), run_at(0.0, "07", False))


def test_which_folder_holds_two_cameras(tmp_path: Path) -> None:
    for name in ("front/strain.h5", "back/strain.h5", "back/session.h5"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()
    assert cameras_in(tmp_path) == ("front", "back") and recorded_cameras_in(tmp_path) == ()
    (tmp_path / "front/session.h5").touch()
    assert recorded_cameras_in(tmp_path) == ("front", "back")
    (tmp_path / "strain.h5").touch()
    assert cameras_in(tmp_path) == () and recorded_cameras_in(tmp_path) == ("front", "back")
    with pytest.raises(DataError, match=r"a test with several cameras; give the folder of one, .*front"):
        (tmp_path / "strain.h5").unlink()
        open_run(tmp_path)


def test_folders_without_an_instant_in_common_are_not_of_one_test(folder: Path) -> None:
    with open_run(folder / "front") as front, open_run(folder / "back") as back:
        back.strain.values["time_s"][:] += 100.0
        with pytest.raises(DataError, match="have no instant in common"):
            SidesOfTest.of_folders(front, back)
