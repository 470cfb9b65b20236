"""The outputs: a trouble in one of them stops that one alone; nothing is overwritten."""

from __future__ import annotations

import datetime
import math
import threading
from pathlib import Path
from typing import Any

import pytest

from acquire.errors import ConfigError, DataError
from acquire.load_cell.log import LoadLog
from analysis import Roi, StrainField, ZoiGrid
from live.measure.measurement import Measurement
from live.outputs.outputs import Outputs
from live.setup.folder import make_folder
from live.setup.sections import SpecimenConfig
from live.tell.card import StatusCard
from live.tell.journal import Journal
from live.tell.ledger import Ledger
from tests.live.fakes import frame

GRID = ZoiGrid.cover(Roi(0, 0, 64, 64), size=32, step=16)


class FakeResults:
    """Keeps what comes; fails where it is told to."""

    def __init__(self, fails_at: int | None = None, error: Exception | None = None) -> None:
        self.rows: list[int] = []
        self.closed = False
        self._fails_at, self._error = fails_at, error or DataError("strain.h5: the disk is full")
        self.go = threading.Event()
        self.go.set()

    def add(self, measurement: Any) -> None:
        self.go.wait(10)
        if self._fails_at == len(self.rows):
            raise self._error
        self.rows.append(measurement.number)

    def close(self) -> None:
        self.closed = True


def measured(number: int) -> Measurement:
    from acquire.burst.accumulate import burst_of

    field = StrainField.from_values(GRID, {"du_dx": 1e-3, "dv_dy": -3e-4}, 1e-5)
    return Measurement(number, burst_of([frame(number)]), field, math.nan)


def outputs(results: FakeResults) -> tuple[Outputs, Journal]:
    journal = Journal()
    card = StatusCard(SpecimenConfig(), LoadLog())
    return Outputs(results, None, journal, card, Ledger()), journal  # type: ignore[arg-type]


def test_every_measurement_is_written_and_kept() -> None:
    results = FakeResults()
    out, journal = outputs(results)
    for number in range(100):
        instant = out.add(measured(number))
    out.close()
    assert instant.exx == pytest.approx(1e-3)
    assert results.rows == list(range(100))
    assert results.closed
    assert len(out.history.instants) == 100
    assert not out.failed
    assert not journal.events()


def test_a_slow_disk_does_not_hold_up_the_measurement() -> None:
    results = FakeResults()
    results.go.clear()
    out, _ = outputs(results)
    for number in range(20):
        out.add(measured(number))  # returns although nothing can be written
    assert len(out.history.instants) == 20
    results.go.set()
    out.close()
    assert results.rows == list(range(20))


@pytest.mark.parametrize(
    ("error", "says"),
    [(DataError("strain.h5: the disk is full"), "the disk is full"), (TypeError("oops"), "by a defect")],
)
def test_a_failure_stops_the_results_alone(error: Exception, says: str) -> None:
    results = FakeResults(3, error)
    out, journal = outputs(results)
    for number in range(200):
        out.add(measured(number))
    out.close()
    assert results.rows == [0, 1, 2]
    assert results.closed
    assert len(out.history.instants) == 200
    assert out.failed
    assert [says in event.text for event in journal.events("error")] == [True]


def test_folders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    now = datetime.datetime(2026, 5, 9, 7, 35, 25, tzinfo=datetime.UTC)
    first, second = make_folder(None, now), make_folder(None, now)
    assert first == Path("runs/20260509T073525Z")
    assert second == Path("runs/20260509T073525Z-2")
    (tmp_path / "mine").mkdir()
    assert make_folder("mine", now) == Path("mine")
    (tmp_path / "mine" / "strain.h5").touch()
    with pytest.raises(ConfigError, match="nothing is overwritten"):
        make_folder("mine", now)
    (tmp_path / "file").touch()
    with pytest.raises(ConfigError, match="cannot be made"):
        make_folder("file/below", now)
