"""Readings by the piece, by value: thinned curves, the part for the lag, and cycles as of one array."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import pytest

from acquire.load_cell import LoadLog
from analysis.evaluate import Figure, Track
from analysis.evaluate.cyclic import cycles as of_cycles
from analysis.evaluate.cyclic.cycles import CycleTable
from analysis.evaluate.cyclic.loop import BurstStrains
from live.results import stored_fields
from live.results.stored_fields import Readings

T = np.arange(1000) / 100
FORCE = np.random.default_rng(3).normal(size=1000)


def in_pieces(t: np.ndarray, force: np.ndarray, size: int) -> Readings:
    def pieces() -> Iterator[Track]:
        return (Track(t[k : k + size], force[k : k + size]) for k in range(0, len(t), size))

    return Readings(pieces)


def test_few_readings_are_all_there() -> None:
    readings = in_pieces(T, FORCE, 300)
    for track in (readings.curve, readings.first(5.0), readings.thinned(1000)):
        assert (track.t.tolist(), track.values.tolist()) == (T.tolist(), FORCE.tolist())
    assert readings.count == 1000 and in_pieces(T[:0], FORCE[:0], 3).curve.t.size == 0


def test_a_thinned_curve_has_the_extremes_of_each_interval_and_the_gaps() -> None:
    force = FORCE.copy()
    force[137], force[450], force[451] = math.nan, 99.0, -99.0
    shown = in_pieces(T, force, 300).thinned(200)
    assert len(shown.t) < 300 and shown.t[0] == T[0] and shown.t[-1] == T[-1]
    assert np.all(np.diff(shown.t) > 0)
    at = np.searchsorted(T, shown.t)
    np.testing.assert_array_equal(shown.values, force[at])
    assert {137, 450, 451} <= {*at.tolist()}
    for start in range(0, 1000, 300):
        piece = range(start, min(start + 300, 1000))
        for k in range(start, piece.stop, 15):
            part = force[k : min(k + 15, piece.stop)]
            chosen = shown.values[(at >= k) & (at < min(k + 15, piece.stop))]
            assert (np.nanmin(chosen), np.nanmax(chosen)) == (np.nanmin(part), np.nanmax(part))


def test_the_lag_of_a_long_test_is_looked_for_from_the_first_picture(monkeypatch: pytest.MonkeyPatch) -> None:
    given: list[Track] = []
    monkeypatch.setattr(stored_fields, "MOST", 400)
    monkeypatch.setattr(stored_fields, "find_lag", lambda *tracks: given.extend(tracks) or Figure.none(""))
    strain = Track(np.arange(4.0, 9.5, 0.25), np.zeros(22))
    in_pieces(T, FORCE, 300).lag_behind(strain)
    assert (given[0].t[0], given[0].t[-1]) == (4.0, 5.75)
    assert given[1].t.tolist() == T[200:600].tolist() and given[1].values.tolist() == FORCE[200:600].tolist()


def test_readings_of_a_log_have_one_zero_and_no_lag() -> None:
    log = LoadLog()
    log.extend(T, FORCE)
    moved = Readings.of_log(log, late_s=0.5).curve
    assert (moved.t.tolist(), moved.values.tolist()) == ((T - 0.5).tolist(), FORCE.tolist())


@pytest.mark.parametrize("size", [7, 64, 5000])
def test_cycles_do_not_depend_on_the_pieces(size: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(of_cycles, "_BLOCK", 100)
    t, at = np.arange(0, 12, 0.01), np.arange(0.003, 12, 0.04)
    t[500:503] = t[500]
    load = -np.cos(2 * np.pi * t) + np.random.default_rng(4).normal(0, 0.01, len(t))
    bursts = BurstStrains(at, -1e-3 * np.cos(2 * np.pi * at), np.full(len(at), 0.01))
    whole = CycleTable.of([Track(t, load)], bursts)
    pieces = CycleTable.of(in_pieces(t, load, size).pieces(), bursts)
    assert len(whole) >= 10
    np.testing.assert_array_equal(pieces.values, whole.values)
