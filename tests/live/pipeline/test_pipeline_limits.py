"""Limits and numbers of the pipeline: what repeats, what moved, what a guard says, columns, counts and health."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from acquire.events import Event, EventKind
from acquire.load_cell.load_log import LoadLog
from acquire.load_sample import LoadSample
from analysis import Roi, Status, StrainField, ZoiGrid
from analysis.evaluate import GaugeValue
from analysis.field.picture_error import PictureError
from live.pipeline import columns
from live.pipeline.columns import BlockFile, NumberColumn, TextColumn
from live.pipeline.event_log import EventLog, sentence
from live.pipeline.guards import (
    BlurGuard,
    DilatationGuard,
    PictureGuard,
    StrainGuard,
    TiltGuard,
    _usual_sigma,
    picture_words,
)
from live.pipeline.history import History
from live.pipeline.measure import Tracker, _share
from live.pipeline.measurement import AXIAL, TRANSVERSE, extension_along, strains_along, time_step_of
from live.pipeline.queues import Thinned
from live.pipeline.reference import averaged, motion_between, repetition_text
from live.pipeline.run_state import ActiveAlarms, FrameCounts, Health
from live.pipeline.snapshot import Snapshot, peak_force
from tests.live.made_up import START, make_field, make_grid, make_measurement

GRID = ZoiGrid.cover(Roi(0, 0, 176, 32), 32, 16)  # ten side by side


def period(*repeating: float, able: int = 100) -> np.ndarray:
    values = np.full(200, np.nan)
    values[:able] = np.inf
    values[: len(repeating)] = repeating
    return values.reshape(10, 20)


def test_a_pattern_repeats_from_a_fiftieth_of_the_zois_on() -> None:
    assert repetition_text(period(8.0, 8.0)) == ""
    assert repetition_text(period(8.0, 9.0, 10.0)) == (
        "the pattern repeats every 9.0 px in 3 of 100 ZOIs; it may move by 3.2 px between two pictures, and to the"
        " first one"
    )


class Moving:
    """A kernel that finds these displacements, one after the other."""

    def __init__(self, *fields: StrainField) -> None:
        self.grid, self._fields, self.starts = GRID, list(fields), list[Any]()

    def measure(self, image: Any, *, start: Any, clipped: Any) -> StrainField:
        self.starts.append(start)
        return self._fields.pop(0)


def seen(u: float, v: float, found: int, status: int = 0) -> StrainField:
    """Of ten ZOIs, the first ``found``; ``status`` of the others."""
    there = np.arange(10)[None] < found
    return StrainField.from_values(
        GRID, {"u": np.where(there, u, np.nan), "v": np.where(there, v, np.nan)}, 1e-3,
        status=np.where(there, 0, status or int(Status.LOST)),
    )  # fmt: skip


@pytest.mark.parametrize(("found", "known"), [(3, True), (2, False), (0, False)])
def test_the_motion_is_known_where_more_than_a_fifth_of_the_zois_are_found(found: int, known: bool) -> None:
    burst = make_measurement(0).burst
    kernel: Any = Moving(seen(1.0, 2.0, 10), seen(1.3, 2.4, found))
    moved = motion_between(kernel, burst, burst)
    assert moved == pytest.approx(0.5) if known else math.isnan(moved)
    assert kernel.starts[0].u[0, 0] == 0.0 and kernel.starts[1].u[0, 0] == 1.0


def test_zois_without_a_pattern_do_not_count() -> None:
    burst = make_measurement(0).burst
    first = seen(0.0, 0.0, 4, int(Status.NO_PATTERN))
    assert motion_between(Moving(first, seen(0.3, -0.4, 1)), burst, burst) == pytest.approx(0.5)  # type: ignore[arg-type]


def test_the_noise_of_a_mean_has_at_least_that_of_the_rounding() -> None:
    assert averaged(0.28, 4) == pytest.approx(12**-0.5 / 2) and averaged(0.29, 4) == pytest.approx(0.145)


def test_the_share_is_that_of_the_active_zois() -> None:
    grid = make_grid()
    field = make_field(grid, 1e-3)
    assert _share(field) == pytest.approx((grid.n_active - 1) / grid.n_active)
    nothing = grid.subset(active=np.zeros(grid.shape, bool))
    assert _share(StrainField.from_values(nothing, {"u": np.nan})) == 0.0


class Lossy:
    """A kernel that measures these shares of ten ZOIs, and can be renewed."""

    def __init__(self, *found: int, renewed: tuple[int, ...] = ()) -> None:
        self._found, self._renewed = list(found), renewed

    def measure(self, image: Any, **_: Any) -> StrainField:
        return seen(0.0, 0.0, self._found.pop(0))

    def renewed(self, *_: Any, **__: Any) -> Lossy:
        if not self._renewed:
            raise ValueError("nothing connects them")
        return Lossy(*self._renewed)


@pytest.mark.parametrize(
    ("second", "again", "renewed"),
    [(8, 10, False), (7, 9, True), (6, 8, True), (6, 7, False), (6, 5, False), (7, None, False)],
)
def test_a_reference_is_renewed_for_a_loss_beyond_the_limit_where_that_finds_half_of_it(
    second: int, again: int | None, renewed: bool
) -> None:
    """More than a fifth is lost from one burst to the next."""
    told: list[Event] = []
    kernel: Any = Lossy(10, second, renewed=() if again is None else (again,))
    tracker = Tracker(kernel, 1.0, 0.2, told.append)
    tracker.measure(make_measurement(0).burst)
    field = tracker.measure(make_measurement(1).burst)
    assert [(event.kind, event.level, event.data["first"]) for event in told] == [
        (EventKind.REFERENCE, "warning", 0)
    ] * renewed
    assert field.n_valid == (again if renewed else second)


def test_the_words_of_a_renewal() -> None:
    told: list[Event] = []
    kernel: Any = Lossy(10, renewed=(10,))
    Tracker(kernel, 1.0, 0.2, told.append).renew_on_demand(make_measurement(2).burst)
    (event,) = told
    assert (event.level, event.t) == ("info", START + 0.2) and event.text.startswith(
        "the reference was renewed as asked;"
    )
    assert event.data == {"first": 16, "last": 23, "n": 8, "automatic": False, "renewed": True}


def field(sigma_xx: float = 30e-6, sigma_yy: float = 40e-6, **values: float) -> StrainField:
    return StrainField.from_values(GRID, {"u": 0.0, **values}, {"du_dx": sigma_xx, "dv_dy": sigma_yy})


def test_the_cost_of_a_picture_is_of_both_directions() -> None:
    assert _usual_sigma(field()) == pytest.approx(50 / math.sqrt(2))
    costly = replace(field(), picture=PictureError(2.0, (1.0, 4.0), "bands"))
    assert picture_words(costly).endswith("uncertain by 35 µm/m in place of 9")
    cheap = replace(field(), picture=PictureError(1.0, (1.0, 1.0), "filter"))
    assert picture_words(cheap).endswith("strain of a ZOI is uncertain by 35 µm/m")
    assert (
        picture_words(replace(field(), picture=PictureError(1.0, (1.0, 1.0)))) == picture_words(field()) == ""
    )


@pytest.mark.parametrize(("factor", "well"), [(1.27, True), (1.28, False)])
def test_a_picture_is_well_again_below_85_hundredths_of_the_limit(factor: float, well: bool) -> None:
    told: list[Event] = []
    guard, step = PictureGuard(told.append), make_measurement(0).time_step
    guard.check(replace(field(), picture=PictureError(3.0, (1.0, 1.0), "noise")), step)
    guard.check(replace(field(), picture=PictureError(3.0, (1.0, 1.0), "bands")), step)
    guard.check(replace(field(), picture=PictureError(factor, (1.0, 1.0), "")), step)
    guard.check(replace(field(), picture=PictureError(factor, (1.0, 1.0), "")), step)
    assert [event.level for event in told] == ["warning", "info"][: 1 + well]
    assert told[0].data == {"cause": "noise", "factor": 3.0, "over_noise": 3.0}


def test_of_a_field_without_zois_a_picture_guard_says_nothing() -> None:
    told: list[Event] = []
    lost = replace(seen(0.0, 0.0, 0), picture=PictureError(3.0, (1.0, 1.0), "noise"))
    PictureGuard(told.append).check(lost, make_measurement(0).time_step)
    assert told == []


@pytest.mark.parametrize(
    ("blur", "sigma", "told"),
    [(0.56, 0.02, False), (0.57, 0.02, True), (-0.57, 0.02, True), (0.501, 0.0, True), (0.5, 0.0, False)],
)
def test_a_blur_is_told_where_it_is_beyond_half_a_pixel_for_certain(
    blur: float, sigma: float, told: bool
) -> None:
    events: list[Event] = []
    step = replace(make_measurement(0).time_step, blur=blur, sigma_blur=sigma)
    BlurGuard(events.append).check(field(), step)
    assert bool(events) == told


def test_a_blur_names_its_cost_where_that_exceeds_the_limit_alone() -> None:
    step = replace(make_measurement(0).time_step, blur=0.8, sigma_blur=0.01)
    for factor, costs in ((1.5, False), (1.51, True)):
        events: list[Event] = []
        BlurGuard(events.append).check(
            replace(field(), picture=PictureError(factor, (1.0, 1.0), "blur")), step
        )
        assert ("is uncertain by" in events[0].text) == costs


@pytest.mark.parametrize(
    ("values", "told"),
    [
        ({"du_dy": -math.radians(0.51), "dv_dx": math.radians(0.51)}, True),
        ({"du_dy": math.radians(0.49), "dv_dx": -math.radians(0.49)}, False),
        ({"du_dx": -0.0201}, True),
        ({"du_dx": -0.0199, "dv_dy": 0.0199}, False),
    ],
)
def test_small_strains_are_valid_up_to_half_a_degree_and_two_percent(
    values: dict[str, float], told: bool
) -> None:
    events: list[Event] = []
    StrainGuard("small", events.append).check(field(**values), make_measurement(0).time_step)
    assert bool(events) == told


def test_the_error_of_small_strains_is_half_the_squares_of_turn_and_strain() -> None:
    events: list[Event] = []
    StrainGuard("small", events.append).check(
        field(du_dy=-0.02, dv_dx=0.02, dv_dy=0.01), make_measurement(0).time_step
    )
    assert (
        "turned by 1.1 degrees, strained by 1.0%: small strains are off by about 248 µm/m" in events[0].text
    )
    assert events[0].data == {"rotation": pytest.approx(0.0199, rel=1e-3), "strain": pytest.approx(0.01)}


def step_of(exx: float, eyy: float, sigma: float = 0.0) -> Any:
    return replace(make_measurement(0).time_step, exx=exx, eyy=eyy, sigma_exx=sigma, sigma_eyy=sigma)


@pytest.mark.parametrize(
    ("false", "axial", "sigma", "told"),
    [
        (21e-6, 0.0, 0.0, True), (19e-6, 0.0, 0.0, False),
        (37e-6, 0.9e-3, 0.0, False), (40e-6, 0.9e-3, 0.0, True),  # 2 % of the strain added
        (40e-6, 0.0, 6.2e-6, False), (41e-6, 0.0, 6.2e-6, True),  # 4 of 5.0 um/m
        (-60e-6, 0.5e-3, 0.0, True), (60e-6, 1.1e-3, 0.0, False),
    ],
)  # fmt: skip
def test_a_false_strain_is_told_beyond_its_limit(
    false: float, axial: float, sigma: float, told: bool
) -> None:
    """sigma of it: 6.2 um/m * sqrt(1 + 0.3^2) / 1.3 are 4.98 um/m."""
    events: list[Event] = []
    step = step_of(-0.3 * axial + false, axial + false, sigma)
    DilatationGuard(0.3, None, events.append).check(field(), step)
    assert bool(events) == told
    if told:
        assert events[0].data["strain"] == pytest.approx(false)
        assert events[0].data["sigma"] == pytest.approx(sigma * math.hypot(1, 0.3) / 1.3)


@pytest.mark.parametrize(
    ("exx", "eyy", "sigma", "told"),
    [(21e-6, 21e-6, 0.0, True), (19e-6, 19e-6, 0.0, False), (49e-6, 49e-6, 1e-5, False), (51e-6, 51e-6, 1e-5, True),
     (1.01e-3, 1.01e-3, 0.0, False), (-30e-6, -30e-6, 0.0, True)],
)  # fmt: skip
def test_strains_that_are_alike_are_told_beyond_their_noise(
    exx: float, eyy: float, sigma: float, told: bool
) -> None:
    events: list[Event] = []
    TiltGuard(None, events.append).check(field(), step_of(exx, eyy, sigma))
    assert [event.data["strain"] for event in events] == ([pytest.approx(exx)] if told else [])
    assert (
        not told
        or f"exx and eyy are alike, {exx * 1e6:+.0f} µm/m: as from motion by {abs(exx):.1e}" in events[0].text
    )
    silent: list[Event] = []
    TiltGuard(None, silent.append, dilatation=False).check(field(), step_of(exx, eyy, sigma))
    assert silent == []


def test_a_column_in_blocks_has_the_newest_two_in_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(columns, "_ROWS", 4)
    column = NumberColumn("d", BlockFile())
    for value in range(11):
        column.append(float(value))
    assert [type(block) is int for block in column._blocks] == [True, False, False]
    assert [column[k] for k in range(11)] == list(range(11))
    assert column.copied(11).tolist() == list(range(11)) and column.copied(5).tolist() == [0, 1, 2, 3, 4]
    still = NumberColumn("i", BlockFile())
    for _ in range(9):
        still.append(7)
    assert [block.strides for block in still._blocks] == [(0,), (0,), (4,)]  # type: ignore[union-attr]
    assert still.copied(9).tolist() == [7.0] * 9
    texts = TextColumn(BlockFile())
    for k in range(9):
        texts.append("ab"[k % 2])
    assert [texts[k] for k in (0, 1, 4, 8)] == ["a", "b", "a", "a"] and texts._texts == ["a", "b"]


def test_a_thinned_list_keeps_every_so_many_th_and_the_newest() -> None:
    kept: Thinned[int] = Thinned(4)
    course = []
    for k in range(10):
        kept.append(k)
        course.append(kept.items())
    assert course[3:6] == [[0, 1, 2, 3], [0, 2, 4], [0, 2, 4, 5]]
    assert course[8:] == [[0, 4, 8], [0, 4, 8, 9]] and kept.halvings == 2


def test_the_counts_of_frames_in_a_line() -> None:
    counts = FrameCounts(grabbed=100, recorded=90, unrecorded=4, thinned=6, reference=8, measured=60, skipped=20,
                         left_out=12, lost=3, load_lost=2)  # fmt: skip
    assert counts.line() == (
        "grabbed 100 / recorded 90 / measured 60 / skipped 20 (25.0%) / lost 3 / load samples lost 2"
        "  (reference 8, left over 12, not recorded 4 and 6 on purpose; adds up)"
    )
    assert FrameCounts(grabbed=2, recorded=2, measured=2).line() == (
        "grabbed 2 / recorded 2 / measured 2 / skipped 0 / lost 0  (reference 0, left over 0, not recorded 0; adds up)"
    )
    assert FrameCounts(load_lost=1).loss and not FrameCounts(skipped=1).loss
    assert list(counts.as_dict()) == [
        "grabbed", "recorded", "unrecorded", "thinned", "reference", "measured", "skipped", "left_out", "lost",
        "load_samples", "load_lost",
    ]  # fmt: skip


def test_health_is_silent_since_the_last_and_has_the_peak_with_its_sign() -> None:
    health = Health(began_t=1.0)
    health.loaded(2.0, -5.0)
    health.loaded(3.0, 4.0)
    health.frame_t, health.disk_s = 2.5, 90.0
    assert health.channels(4.0) == {"silent_s": 1.5, "load_silent_s": 1.0, "disk_min": 1.5}
    assert health.peak_N == -5.0
    assert peak_force(-5.0, 5.0) == -5.0 and peak_force(-5.0, 5.1) == 5.1
    assert (
        Snapshot(0.0, frames={"lost": 2, "unrecorded": 3, "skipped": 9}).lost == 5 and Snapshot(0.0).lost == 0
    )


def test_alarms_that_are_on_are_told_oldest_first() -> None:
    alarms = ActiveAlarms()
    for name in "ab":
        alarms.set(name, f"{name}: high")
    alarms.set("a", "a: higher")
    assert alarms.texts == ("a: higher", "b: high")
    alarms.clear("a")
    alarms.clear("none")
    assert alarms.texts == ("b: high",) and alarms.silence() == ("b",) and alarms.silence() == ()


def test_the_strains_along_and_across_the_load() -> None:
    assert strains_along((), "x") == ("exx", "eyy") and strains_along((), "y") == ("eyy", "exx")
    assert strains_along((AXIAL,), "x") == (AXIAL, "eyy") and strains_along((TRANSVERSE,), "y") == (
        "eyy",
        TRANSVERSE,
    )
    assert (extension_along((), "x"), extension_along((AXIAL,), "x")) == ("extension_x", AXIAL)


def test_a_time_step_has_the_largest_strain_by_magnitude_with_its_sign() -> None:
    values = np.full((1, 10), 1e-3)
    values[0, 3], values[0, 7] = -4e-3, 3e-3
    one = StrainField.from_values(
        GRID, {"u": 2.0, "v": -1.0, "dv_dy": values, "du_dx": 2e-3}, {"du_dx": 1e-6, "dv_dy": 3e-6}
    )
    step = time_step_of(make_measurement(0).burst, one, 12.0, 0.25)
    assert (step.largest, step.u, step.v) == (pytest.approx(-4e-3), 2.0, -1.0)
    assert (step.zoi_sigma, step.n_valid, step.n_zoi) == (pytest.approx(3e-6), 10, 10)
    assert (step.force, step.measure_s, step.noise_GL, step.refused) == (12.0, 0.25, 2.5, "")
    lost = time_step_of(make_measurement(0).burst, seen(0.0, 0.0, 0), math.nan)
    assert math.isnan(lost.largest) and math.isnan(lost.zoi_sigma) and lost.refused == "10 LOST"


def test_the_least_share_is_of_the_region_and_of_gauges_that_have_a_value() -> None:
    step = replace(make_measurement(0).time_step, area_share=0.9)
    gauges = {"a": GaugeValue(0.0, 0.0, "", 0.8), "b": GaugeValue(math.nan, math.nan, "lost", 0.1)}
    assert step.least_share == 0.9 and replace(step, gauges=gauges).least_share == 0.8


def test_the_history_has_values_once_any_zoi_had_one() -> None:
    history = History()
    assert not history.has_values
    history.add(replace(make_measurement(0).time_step, n_valid=0))
    assert not history.has_values
    history.add(make_measurement(1).time_step)
    assert history.has_values


def test_what_was_tared_before_the_first_measurement_is_not_of_the_test() -> None:
    history, loads = History("y"), LoadLog()
    for k, step_N in ((0, 50.0), (2, 7.0)):
        loads.append(LoadSample(START + k, 10.0))
        loads.take_event(Event(START + k + 0.5, EventKind.TARE, "a cell", "", "info", {"step_N": step_N}))
    assert history.tared_in_mid_test(loads) == 0.0
    for t in (1.0, 3.0):
        history.add(replace(make_measurement(0).time_step, t=START + t))
    assert history.tared_in_mid_test(loads) == 7.0


def test_events_of_devices_have_the_time_of_the_test_and_those_of_frames_keep_theirs() -> None:
    log, told = EventLog(), list[Event]()
    log.origin = 100.0
    log(Event(103.0, EventKind.NOTE, "a", "one", "info"))
    log.record(Event(3.5, EventKind.MEASURED, "m", "two", "info"))
    log.record(Event(3.6, EventKind.NOTE, "m", "three", "warning"))
    log.add_listener(told.append)
    log.record(Event(3.7, EventKind.MEASURED, "m", "four", "info"))
    assert [(event.t, event.text) for event in told] == [(3.0, "one"), (3.6, "three"), (3.7, "four")]
    assert [event.text for event in log.events("warning")] == ["three"] and len(log.events()) == 2


def test_the_source_of_an_event_is_named_once() -> None:
    event = Event(0.0, EventKind.DEVICE, "sim:a", "sim:a: gone", "error")
    assert sentence(event) == "sim:a: gone" and sentence(event, {"sim:a": "camera"}) == "camera: gone"
