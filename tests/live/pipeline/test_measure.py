"""The measuring path: noise, renewal of the reference, guards, means, force matching, and the history."""

from __future__ import annotations

import math
import re
import tracemalloc
from dataclasses import fields, replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from acquire.events import Event, EventKind
from acquire.frame import Burst
from acquire.load_cell.load_log import LoadLog
from acquire.load_sample import LoadSample
from analysis import KernelSettings, PhaseKernel, Roi, StrainField, ZoiGrid
from analysis.evaluate import GaugeValue
from hw_mocks.deformation import Affine
from hw_mocks.speckle import Speckle
from live.pipeline.guards import BlurGuard, standard_guards
from live.pipeline.history import SHORT, AxisFinder, History, curve_of
from live.pipeline.measure import NewReference, Tracker, measure
from live.pipeline.measurement import HOLD_S, ForceMatching, Measurement, TimeStep, ordered_mean
from live.pipeline.reference import averaged, frame_noise, motion_between, prepare
from tests.live.made_up import START, in_ascii, make_loads, make_measurement

SHAPE = (160, 192)
GRID = ZoiGrid.cover(Roi(24, 24, 144, 112), size=32, step=16)


def burst(image: np.ndarray, number: int, n: int = 1, noise: float = math.nan) -> Burst:
    nothing = np.zeros(image.shape, bool)
    return Burst(
        image.astype(np.float32), n, noise, nothing, 8, float(number), 0.0, number, number, 0, "nominal"
    )


def picture(speckle: Speckle, **gradient: float) -> np.ndarray:
    return np.asarray(255 * speckle.render(Affine(x0=96, y0=80, **gradient), SHAPE))


@pytest.fixture(scope="module")
def speckle() -> Speckle:
    return Speckle(SHAPE, radius=2.0, seed=5)


def test_noise_is_that_of_the_average() -> None:
    image = np.zeros((4, 4))
    assert frame_noise(burst(image, 0), None) is None
    assert frame_noise(burst(image, 0, 8, 1.5), None) == 1.5
    assert frame_noise(burst(image, 0, 8, 1.5), 3.0) == 3.0
    assert frame_noise(burst(image, 0, 8, 0.0), None) is None  # no scatter at all tells nothing
    assert averaged(2.0, 16) == 0.5
    assert averaged(0.0, 1) == pytest.approx(12**-0.5), "at least that of the rounding"
    assert averaged(0.28, 4) == pytest.approx(12**-0.5 / 2) and averaged(0.29, 4) == pytest.approx(0.145)
    assert averaged(None, 4) is None


def test_each_burst_with_its_force(speckle: Speckle) -> None:
    loads = LoadLog(10.0)
    for t in range(4):
        loads.append(LoadSample(t=float(t), force=100.0 * t))
    kernel, noise = prepare(burst(picture(speckle), 0, 8, 1.0), GRID, KernelSettings(), None)
    assert noise == 1.0
    bursts = [burst(picture(speckle, v=0.3 * i, dv_dy=1e-3 * i), i) for i in (1, 2, 3)]
    found = list(measure(bursts, Tracker(kernel, noise), loads))
    assert [m.number for m in found] == [0, 1, 2]
    assert [m.force for m in found] == [100.0, 200.0, 300.0]
    assert [m.field.mean("eyy")[0] for m in found] == pytest.approx([1e-3, 2e-3, 3e-3], abs=5e-6)


def test_motion_between_halves(speckle: Speckle) -> None:
    kernel, _ = prepare(burst(picture(speckle, u=0.05), 0), GRID, KernelSettings(), 1.0)
    moved = motion_between(kernel, burst(picture(speckle), 1), burst(picture(speckle, u=0.1), 2))
    assert moved.px == pytest.approx(0.1, abs=0.002) and not moved.pulled


def test_a_pull_between_halves_is_seen_where_its_middle_stands_still(speckle: Speckle) -> None:
    """At 10 frames a second the demo took its reference while it pulled: 46 um/m were missing in every strain."""
    kernel, _ = prepare(burst(picture(speckle), 0), GRID, KernelSettings(), 1.0)
    middle = {"v": -3e-4 * (SHAPE[0] - 1) / 2, "dv_dy": 3e-4}
    moved = motion_between(kernel, burst(picture(speckle), 1), burst(picture(speckle, **middle), 2))
    assert moved.px < 0.05 and moved.pulled and moved.strain == pytest.approx(3e-4, abs=4 * moved.sigma)


@pytest.mark.parametrize("on_demand", [True, False])
def test_a_renewed_reference_stays_composed(speckle: Speckle, on_demand: bool) -> None:
    told: list[Event] = []
    images = [picture(speckle, u=2.0, du_dx=0.02), picture(speckle, u=3.0, du_dx=0.03)]
    kernel, noise = prepare(burst(picture(speckle), 0), GRID, KernelSettings(), 1.0)
    if on_demand:
        steps = [burst(images[0], 1), NewReference(burst(images[0], 2)), burst(images[1], 3)]
    else:
        # On the left another pattern fades in: the first reference no longer fits the last picture there.
        left = np.arange(SHAPE[1]) < 96
        other = Speckle(SHAPE, radius=2.0, seed=6)
        fading = zip((0.96, 0.92), ({"u": 2.0, "du_dx": 0.02}, {"u": 3.0, "du_dx": 0.03}), strict=True)
        shares = ((np.where(left, w, 1), g) for w, g in fading)
        mixed = [w * picture(speckle, **g) + (1 - w) * picture(other, **g) for w, g in shares]
        steps = [burst(image, i) for i, image in enumerate(mixed, 1)]
    found = watched(steps, kernel, noise, told, 0.2)
    renewals = [event for event in told if event.kind is EventKind.REFERENCE]
    assert len(renewals) == 1
    assert renewals[0].data["automatic"] is not on_demand
    last = found[-1].field
    assert np.isfinite(last.exx).mean() > (0.99 if on_demand else 0.7)
    assert last.mean("exx")[0] == pytest.approx(0.03, abs=2e-5 if on_demand else 2e-3)


def watched(
    bursts: list[Burst | NewReference],
    kernel: PhaseKernel,
    noise: float | None,
    told: list[Event],
    renew_at: float = 1.0,
) -> list[Measurement]:
    """The measurements, with all events of kernel and guards in ``told``."""
    guards = standard_guards(kernel, "small", told.append)
    return list(measure(bursts, Tracker(kernel, noise, renew_at, told.append), LoadLog(), guards=guards))


def test_a_blank_picture_does_not_end_the_measurement(speckle: Speckle) -> None:
    kernel, noise = prepare(burst(picture(speckle), 0), GRID, KernelSettings(), 1.0)
    told: list[Event] = []
    blank = np.full(SHAPE, 128.0)
    steps = [burst(blank, 1), NewReference(burst(blank, 2)), burst(picture(speckle, u=0.4), 3)]
    found = watched(steps, kernel, noise, told, 0.2)
    assert np.isnan(found[0].field.u).all()
    assert np.isfinite(found[1].field.u).all()
    assert found[1].field.mean("u")[0] == pytest.approx(0.4, abs=1e-3)
    assert "was not renewed" in told[0].text


def test_a_pattern_that_repeats_is_an_event_at_the_first_burst(speckle: Speckle) -> None:
    told: list[Event] = []
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]]
    k = 2 * np.pi / 8
    for image, words in (
        (120 + 40 * (np.sin(k * x) + np.sin(k * y)), ["every 8.0 px"]),
        (picture(speckle), []),
    ):
        kernel, noise = prepare(burst(image, 0), GRID, KernelSettings(), 1.0)
        told.clear()
        watched([burst(image, 1), burst(image, 2)], kernel, noise, told)
        assert len(told) == len(words) and all(word in told[0].text for word in words)
        assert all(event.level == "warning" and event.t == 1.0 for event in told)


def time_steps(count: int) -> list[TimeStep]:
    """Still for a third, then pulled along x."""
    one, rng = make_measurement(0).time_step, np.random.default_rng(1)
    found = []
    for k in range(count):
        e = 1e-3 * max(0.0, 3 * k / count - 1)
        exx, eyy, exy = np.array([e, -0.3 * e, 0.0]) + rng.normal(0, 1e-6, 3)
        found.append(replace(one, t=START + k, exx=exx, eyy=eyy, exy=exy))
    return found


@pytest.mark.parametrize("most", [2000, 50])
def test_y_until_the_strains_tell(monkeypatch: pytest.MonkeyPatch, most: int) -> None:
    monkeypatch.setattr("live.pipeline.history.MAX_KEPT", most)
    finder, course = AxisFinder("auto"), time_steps(300)
    told = [finder.add(i) for i in course]
    assert set(told[:100]) == {"y"} and set(told[130:]) == {"x"}
    assert len(finder._strains.kept) <= most
    again = AxisFinder("auto")
    assert [again.add(i) for i in course for _ in range(2)][::2] == told, "told twice it counts once"


def test_of_few_time_steps_the_larger_sigma_decides_whether_a_strain_is_clear() -> None:
    one = replace(make_measurement(0).time_step, t=START, exx=1e-3, eyy=0.0, exy=0.0)
    for sigma_exx, sigma_eyy, axis in ((1e-6, 1e-6, "x"), (1e-4, 1e-6, "y"), (1e-6, 1e-4, "y")):
        finder = AxisFinder("auto")
        assert finder.add(replace(one, sigma_exx=sigma_exx, sigma_eyy=sigma_eyy)) == axis
        assert finder.assumed is (axis == "y")


def test_what_is_given_holds() -> None:
    for axis in ("x", "y"):
        finder = AxisFinder(axis)
        assert {finder.add(i) for i in time_steps(100)} == {axis}


def test_a_change_of_sharpness_is_told_once_and_when_it_ends() -> None:
    told: list[Event] = []
    guard, still = BlurGuard(told.append), make_measurement(0)
    # Not known, small, not certain, certain, still, nearly well, well, sharper.
    changes = [(math.nan, math.nan), (0.4, 0.01), (0.55, 0.05), (0.62, 0.02), (0.9, 0.02), (0.45, 0.02), (0.1, 0.02),
               (-0.7, 0.02)]  # fmt: skip
    for blur, sigma in changes:
        guard.check(still.field, replace(still.time_step, blur=blur, sigma_blur=sigma))
    assert [event.level for event in told] == ["warning", "info", "warning"]
    assert "less sharp by 0.62 ± 0.02 px" in told[0].text and "sharper by 0.70 ± 0.02 px" in told[2].text
    assert told[0].data == {"blur_px": 0.62, "sigma_blur_px": 0.02}


def test_a_blurred_picture_is_told_with_its_width_and_changes_no_strain(speckle: Speckle) -> None:
    still = picture(speckle)
    bursts = [burst(gaussian_filter(still, blur), k) for k, blur in enumerate((0.0, 0.0, 0.8))]
    kernel, noise = prepare(bursts[0], GRID, KernelSettings(), 1.0)
    told: list[Event] = []
    found = watched(bursts[1:], kernel, noise, told)
    assert abs(found[0].time_step.blur) < 0.02
    assert found[1].time_step.blur == pytest.approx(0.8, abs=0.1)
    assert abs(found[1].time_step.exx) < 30e-6
    assert [event.source for event in told] == ["sharpness"] and told[0].t == 2.0


def test_what_the_picture_has_become_is_told_once_with_its_cost_and_when_it_ends(speckle: Speckle) -> None:
    rng = np.random.default_rng(3)
    noises = (1.0, 1.0, 5.0, 5.0, 1.0, 5.0)
    bursts = [burst(picture(speckle) + rng.normal(0, s, SHAPE), k) for k, s in enumerate(noises)]
    kernel, noise = prepare(bursts[0], GRID, KernelSettings(), 1.0)
    told: list[Event] = []
    found = watched(bursts[1:], kernel, noise, told, 0.1)
    assert [(event.level, event.t) for event in told] == [("warning", 2.0), ("info", 4.0), ("warning", 5.0)]
    assert told[0].data["cause"] == "noise" and told[0].data["factor"] == pytest.approx(13**0.5, rel=0.1)
    costs = [float(np.nanmedian(m.field.sigma_exx)) * 1e6 for m in found[:2]]
    shown = re.findall(r"(\d+) um/m", in_ascii(told[0].text))
    assert list(map(int, shown)) == pytest.approx([costs[1], costs[0]], rel=0.1)
    assert all(m.field.ok.all() for m in found)


@pytest.mark.parametrize("size", [1, 7, 945, 15_129])
def test_the_mean_does_not_depend_on_the_place_in_memory(size: int) -> None:
    values = np.random.default_rng(size).normal(1e-3, 1.0, size).astype(np.float32)
    means = set()
    for offset in range(0, 64, 4):
        room = np.empty(size * 4 + 64, np.uint8)
        place = room[offset : offset + size * 4].view(np.float32)
        place[:] = values
        means.add(ordered_mean(place))
    assert len(means) == 1
    assert means.pop() == pytest.approx(math.fsum(values.tolist()) / size, rel=1e-12)


def test_the_mean_of_nothing_is_not_a_number() -> None:
    assert math.isnan(ordered_mean(np.empty(0, np.float32)))


def test_a_measurement_waits_for_its_force() -> None:
    loads = make_loads(0.15, lambda t: 100.0 * t)
    matching = ForceMatching(loads)
    matched = [m for k in range(3) for m in matching.add(make_measurement(k))]
    assert (len(matched), len(matching)) == (2, 1)
    for k in range(16, 40):
        loads.append(LoadSample(START + k / 100, float(k)))
    matched += matching.add(make_measurement(3))
    assert len(matching) == 0
    np.testing.assert_allclose([m.force for m in matched], [0.0, 10.0, 20.0, 30.0], atol=1e-6)
    assert [m.number for m in matched] == [0, 1, 2, 3]


NUMBERS = [one.name for one in fields(TimeStep) if one.name not in ("refused", "gauges")]


def some(i: int) -> TimeStep:
    numbers = {name: (i * 31 + k) if name.startswith("n_") and "noise" not in name else i * 0.37 + k
               for k, name in enumerate(NUMBERS)}  # fmt: skip
    gauges = {
        "axial": GaugeValue(i * 1e-5, 1e-6),
        "hole": GaugeValue(math.nan, math.nan, f"{i % 3} ZOIs lost"),
    }
    return TimeStep(**numbers, refused=f"{i % 4} LOST", gauges=gauges)


def as_kept(time_step: TimeStep) -> TimeStep:
    """With seven digits of the uncertainties and of what is for information."""
    short = {name: float(np.float32(getattr(time_step, name))) for name in SHORT}
    gauges = {
        name: replace(gauge, share=float(np.float32(gauge.share))) for name, gauge in time_step.gauges.items()
    }
    return replace(time_step, **short, gauges=gauges)


def test_what_goes_in_comes_out() -> None:
    history, put = History(), [some(i) for i in range(40)]
    for time_step in put:
        history.add(time_step)
    put = [as_kept(time_step) for time_step in put]
    assert len(history.time_steps) == 40
    assert [repr(time_step) for time_step in history.time_steps] == [repr(time_step) for time_step in put]
    assert repr(history.time_steps[-1]) == repr(put[-1]) and isinstance(history.time_steps[-1].n_zoi, int)
    assert repr(history.time_steps[3:9:2]) == repr(put[3:9:2])
    for name in NUMBERS:
        assert np.array_equal(history.column(name), [getattr(time_step, name) for time_step in put])
    axial = history.gauge("axial")
    assert axial is not None and np.array_equal(axial, [i * 1e-5 for i in range(40)])
    for beyond in (40, -41):
        with pytest.raises(IndexError):
            history.time_steps[beyond]


def test_numbers_of_hours_come_out_whether_they_change_or_not() -> None:
    """In blocks of 1024, of which those without a change are kept as one number."""
    history, axial = History(), {"axial": GaugeValue(0.25, 0.125)}
    zeros = [0.0] * 1030 + [-0.0] * 10 + [7.25] * 2000
    raw = [math.nan] * 2000 + [1.0] * 1040
    for i, (zero, force) in enumerate(zip(zeros, raw, strict=True)):
        history.add(replace(some(i), zero=zero, force_raw=force, gauges=axial if i >= 1500 else {}))
    assert repr(history.column("zero").tolist()) == repr(zeros), "-0.0 is not 0.0"
    assert np.array_equal(history.column("force_raw"), raw, equal_nan=True)
    assert np.array_equal(history.column("t"), np.arange(3040) * 0.37)
    for i in (0, 1023, 1024, 1035, 2999, -1):
        step = history.time_steps[i]
        assert repr((step.zero, step.force_raw)) == repr((zeros[i], raw[i]))
        assert step.refused == f"{range(3040)[i] % 4} LOST"
    assert [len(history.time_steps[i].gauges) for i in (0, 1499, 1500, 3039)] == [0, 0, 1, 1]


def test_a_gauge_that_comes_and_goes() -> None:
    history, late = History(), {"late": GaugeValue(1.0, 0.125)}
    for gauges in ({}, late, {}):
        history.add(replace(some(0), gauges=gauges))
    assert [dict(time_step.gauges) for time_step in history.time_steps] == [{}, late, {}]
    assert history.gauge("late") is None, "the first instant has none of that name"


def test_a_gauge_keeps_its_share_and_why_it_was_lost() -> None:
    history, held = (
        History(),
        [GaugeValue(1e-3, 1e-6, "", 0.75), GaugeValue(math.nan, math.nan, "lost", 0.25)],
    )
    for one in held:
        history.add(replace(some(0), gauges={"left": one}))
    found = [step.gauges["left"] for step in history.time_steps]
    assert repr(found) == repr(held)
    sigma = history.time_steps.gauge_sigma("left")
    assert sigma is not None and repr(sigma.tolist()) == "[1e-06, nan]"


def test_the_columns_grow_while_they_are_read() -> None:
    history = History()
    history.add(some(0))
    column, axial = history.column("t"), history.gauge("axial")
    history.add(some(1))
    assert column.size == 1 and axial is not None and axial.size == 1


@pytest.mark.slow
def test_little_memory() -> None:
    history = History()
    tracemalloc.start()
    for i in range(20_000):
        history.add(some(i))
    grown = tracemalloc.get_traced_memory()[0] / 20_000
    tracemalloc.stop()
    assert grown < 250, "bytes an instant with two gauges"


@pytest.mark.slow
def test_numbers_that_do_not_change_take_no_memory() -> None:
    history, still = History("y"), make_measurement(0).time_step
    tracemalloc.start()
    for i in range(20_480):
        history.add(replace(still, t=1e-3 * i))
    grown = tracemalloc.get_traced_memory()[0] / 20_480
    tracemalloc.stop()
    assert grown < 8 + 8, "bytes an instant: its time"


def test_the_means_of_an_old_file_are_not_called_strains_of_the_region() -> None:
    """Before the extension had columns, exx and eyy were means of the gradients."""
    values = {"exx": np.zeros(3), "eyy": np.arange(3.0)}
    for old, words in ((True, "mean eyy"), (False, "eyy of the region")):
        held = values if old else values | {"extension_y": np.full(3, np.nan)}
        assert curve_of(held.get, (), "y", np.arange(3.0), np.zeros(3)).source == words


@pytest.mark.parametrize(("axis", "across"), [("x", "y"), ("y", "x")])
def test_the_curve_of_the_region_is_of_the_columns_along_and_across_the_load(axis: str, across: str) -> None:
    names = ("extension_{}", "e{0}{0}", "uneven_e{0}{0}", "sigma_lens_e{0}{0}")
    held = {
        name.format(one): np.arange(3.0) + k + 10 * (one == "x")
        for k, name in enumerate(names)
        for one in "xy"
    }
    held |= {"misfit": np.full(3, 5.0), "blur": np.full(3, 6.0)}
    found = curve_of(held.get, (), axis, np.arange(3.0), np.arange(3.0) * 1e6)
    along = {
        "strain": f"extension_{axis}", "elastic": f"e{axis * 2}", "uneven": f"uneven_e{axis * 2}",
        "lens": f"sigma_lens_e{axis * 2}", "transverse": f"e{across * 2}", "narrowing": f"extension_{across}",
        "misfit": "misfit", "blur": "blur",
    }  # fmt: skip
    for attribute, column in along.items():
        np.testing.assert_array_equal(getattr(found, attribute), held[column], err_msg=attribute)


def test_a_tare_in_mid_test_has_the_sign_of_what_it_took_off() -> None:
    """40 N were made zero between the two instants: forces fall, and are put back."""
    history, loads = History("y"), LoadLog()
    for k, force in enumerate((100.0, 140.0, 0.0, 20.0)):
        if k == 2:
            tare = {"step_N": 140.0}
            loads.take_event(Event(START + 1.5, EventKind.TARE, "a cell", "", "info", tare))
        loads.append(LoadSample(START + k, force))
    for t in (0.5, 3.0):
        history.add(replace(make_measurement(0).time_step, t=START + t))
    assert history.tared_in_mid_test(loads) == 140.0
    assert history.forces(loads)[-1] == 160.0
    assert History("y").tared_in_mid_test(loads) == 0.0


class NoiseOfKernel:
    """In place of a kernel: keeps the noise that it is given, loses every ZOI of the second burst, finds all others."""

    def __init__(self, given: list[tuple[str, float | None]]) -> None:
        self.given = given

    def measure(self, image: np.ndarray, *, noise: float | None, **_: object) -> StrainField:
        self.given.append(("measured", noise))
        lost = len(self.given) == 2
        return StrainField.from_values(GRID, {"u": math.nan if lost else 0.0}, 1e-3)

    def renewed(self, image: np.ndarray, field: StrainField, *, noise: float | None) -> NoiseOfKernel:
        self.given.append(("renewed", noise))
        return self


def test_every_picture_is_measured_and_renewed_with_the_noise_of_its_own_mean() -> None:
    """A renewal that the pipeline makes by itself takes the burst before: that of one frame has more noise."""
    given: list[tuple[str, float | None]] = []
    told: list[Event] = []
    tracker = Tracker(NoiseOfKernel(given), 2.0, 0.5, told.append)  # type: ignore[arg-type]
    still = np.zeros(SHAPE)
    tracker.measure(burst(still, 0, 4))
    tracker.measure(burst(still, 1, 16))
    assert given == [("measured", 1.0), ("measured", 0.5), ("renewed", 1.0), ("measured", 0.5)]
    tracker.renew_on_demand(burst(still, 2, 64))
    assert given[4:] == [("measured", 0.25), ("renewed", 0.25)]
    assert [event.data["n"] for event in told] == [4, 64]


def loads(until: float, lag_s: float = 0.0) -> LoadLog:
    """10 N at the START and 100 N more each second, tared by 5 N a quarter of a second in."""
    log = LoadLog(lag_s=lag_s)
    for k in range(round(100 * until) + 1):
        log.append(LoadSample(START + k / 100, 10.0 + k))
    log.take_event(Event(START + 0.25, EventKind.TARE, "a cell", "", "info", {"step_N": 5.0}))
    return log


def test_the_last_ones_have_the_force_of_their_time() -> None:
    """They wait until the run ends, and what came meanwhile counts."""
    log = loads(0.15)
    matching = ForceMatching(log)
    waiting = [m for k in (2, 3) for m in matching.add(make_measurement(k))]
    assert waiting == [] and len(matching) == 2
    for k in range(16, 40):
        log.append(LoadSample(START + k / 100, 10.0 + k))
    last = matching.flush()
    assert [m.force for m in last] == pytest.approx([30.0, 40.0])
    assert [m.time_step.zero for m in last] == [0.0, 5.0]
    assert len(matching) == 0 and matching.flush() == []


def test_a_lag_is_taken_off_and_the_stamped_force_kept() -> None:
    matching = ForceMatching(loads(1.0, lag_s=0.05))
    (matched,) = matching.add(make_measurement(3))
    assert matched.force == pytest.approx(45.0)
    assert matched.time_step.force_raw == pytest.approx(40.0)


def test_a_force_is_final_once_the_log_reaches_past_the_lag() -> None:
    matching = ForceMatching(loads(0.12, lag_s=0.05))
    assert [m.number for k in (0, 1) for m in matching.add(make_measurement(k))] == [0]


def test_it_waits_no_longer_than_that() -> None:
    matching, held = ForceMatching(LoadLog()), round(HOLD_S / 0.1)
    given = [len(matching.add(make_measurement(k))) for k in range(held + 3)]
    assert given[:held] == [0] * held and sum(given) in (2, 3)
    assert np.isnan([m.force for m in matching.flush()]).all() and len(matching) == 0
