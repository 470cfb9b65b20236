"""A reference: its pattern, how far things moved since, and when it is renewed."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from acquire.errors import TooLittleMemory
from acquire.events import Event, EventKind
from analysis import KernelSettings, Roi, Status, StrainField, ZoiGrid
from live.pipeline import reference
from live.pipeline.measure import Tracker, _share
from live.pipeline.reference import ReferenceMotion, motion_between, prepare, repetition_text
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
        "the pattern repeats every 9.0 px in 3 of 100 ZOIs; it may move by 3.8 px between two pictures, and to the"
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
    assert moved.px == pytest.approx(0.5) if known else math.isnan(moved.px)
    assert kernel.starts[0].u[0, 0] == 0.0 and kernel.starts[1].u[0, 0] == 1.0


def test_zois_without_a_pattern_do_not_count() -> None:
    burst = make_measurement(0).burst
    first = seen(0.0, 0.0, 4, int(Status.NO_PATTERN))
    assert motion_between(Moving(first, seen(0.3, -0.4, 1)), burst, burst).px == pytest.approx(0.5)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("strain", "sigma", "pulled"),
    [(2.1e-5, 4e-6, True), (-2.1e-5, 4e-6, True), (2.1e-5, 4.3e-6, False), (1.9e-5, 1e-7, False)],
)
def test_a_reference_is_pulled_beyond_five_sigma_and_twenty_micrometres_a_metre(
    strain: float, sigma: float, pulled: bool
) -> None:
    assert ReferenceMotion(0.01, strain, sigma).pulled is pulled
    assert not ReferenceMotion(0.01).pulled


@pytest.mark.parametrize("known", [True, False])
def test_too_little_memory_is_one_sentence_with_the_way_out(
    known: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Before anything is taken where it is known what there is, else when the system refuses."""

    def refused(*_: object) -> None:
        raise MemoryError

    monkeypatch.setattr(reference, "available_MiB", lambda: 0.01 if known else math.nan)
    monkeypatch.setattr("analysis.PhaseKernel", refused)
    words = r"ZOIs in a picture .* take about \d+ MiB.*: take a larger step or a smaller roi"
    with pytest.raises(TooLittleMemory, match=words):
        prepare(make_measurement(0).burst, make_grid(), KernelSettings(), 1.0)


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
