"""The corrections in their order, lost plates, and the path of a burst."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from acquire.events import Event
from acquire.load_cell.load_log import LoadLog
from acquire.load_sample import LoadSample
from analysis import Roi, StrainField, ZoiGrid
from analysis.evaluate import ZoiGauge
from analysis.optics import PlateFit
from live.config.loading import load_config
from live.pipeline import measure as module
from live.pipeline.measure import Corrections, NewReference, PlateCorrection, measure
from live.setup.grid import plates_for
from tests.live.made_up import START, make_measurement

SHAPE = (96, 256)
CONFIG = load_config(
    None,
    {
        "measure.zoi": 16, "measure.step": 8, "measure.roi": [96, 0, 64, 96],
        "plate.left": {"box": [0, 0, 80, 96]}, "plate.right": {"box": [176, 0, 80, 96]},
    },
)  # fmt: skip
GRID = ZoiGrid.cover(Roi(96, 0, 64, 96), 16, 8)


def fit() -> PlateFit:
    layout = plates_for(CONFIG, GRID, SHAPE[1], SHAPE[0])
    assert layout is not None
    return PlateFit(layout, (127.5, 47.5))


def whole(of: PlateFit, scale: float) -> StrainField:
    """Motion towards the camera alone, of plates and specimen."""
    grid = of.layout.whole
    x, y = np.meshgrid(grid.x - 127.5, grid.y - 47.5)
    values = {"u": scale * x, "v": scale * y, "du_dx": scale, "dv_dy": scale}
    return StrainField.from_values(grid, values, 1e-6)


def test_where_a_plate_is_lost_the_last_motion_is_removed_until_it_is_found_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    words = iter([("", False), ("plate left is lost", False), ("plate left is lost", False), ("", False)])
    monkeypatch.setattr(module, "trouble", lambda fit, field: next(words))
    told: list[Event] = []
    of = fit()
    correction = PlateCorrection(of, 5000.0, told.append)
    found = [
        correction.apply(whole(of, scale), make_measurement(k).burst, "small")
        for k, scale in enumerate((1e-3, 3e-3, 4e-3, 2e-3))
    ]
    assert [reading.corrected for _, reading in found] == [True, False, False, True]
    strains = [float(np.nanmean(field.exx)) for field, _ in found]
    assert strains == pytest.approx([0.0, 2e-3 / 1.001, 3e-3 / 1.001, 0.0], abs=1e-6), (
        "that of the first stays removed"
    )
    raw = [reading.raw_strain("exx") for _, reading in found]
    assert raw == pytest.approx([1e-3, 3e-3, 4e-3, 2e-3], abs=2e-6)
    assert [(event.level, event.t) for event in told] == [
        ("info", START), ("error", START + 0.1), ("info", START + 0.3),
    ]  # fmt: skip
    assert told[0].text.startswith("plates left, right: ") and "is corrected" in told[0].text
    assert told[1].text.startswith("plate left is lost; the correction by plates has stopped")
    assert told[2].text == "the plates are measured again, and the correction goes on"


def test_where_a_plate_is_not_rigid_the_correction_ends_for_good(monkeypatch: pytest.MonkeyPatch) -> None:
    words = iter([("", False), ("plate left is loaded", True), ("", False)])
    monkeypatch.setattr(module, "trouble", lambda fit, field: next(words))
    told: list[Event] = []
    of = fit()
    correction = PlateCorrection(of, 5000.0, told.append)
    found = [correction.apply(whole(of, 1e-3), make_measurement(k).burst, "small")[1] for k in range(3)]
    assert [reading.corrected for reading in found] == [True, False, False]
    assert [event.level for event in told] == ["info", "error"]
    assert 0 < found[0].sigma_scale < 1e-6


def test_the_model_of_the_plates_is_chosen_once(monkeypatch: pytest.MonkeyPatch) -> None:
    chosen: list[float] = []
    plain = module.choose_model

    def choose(fit: PlateFit, field: StrainField, focal_px: float) -> Any:
        chosen.append(focal_px)
        return plain(fit, field, focal_px)

    monkeypatch.setattr(module, "choose_model", choose)
    of = fit()
    correction = PlateCorrection(of, 5000.0, lambda event: None)
    for k in range(2):
        correction.apply(whole(of, 1e-3), make_measurement(k).burst, "small")
    assert chosen == [5000.0]


class Step:
    """A correction that notes its turn."""

    def __init__(self, name: str, order: list[Any]) -> None:
        self.name, self.order = name, order

    def apply(self, field: Any, *more: Any) -> Any:
        self.order.append((self.name, *more))
        return (field, f"of {self.name}") if self.name != "shutter" else field


def test_shutter_lens_and_plates_follow_one_another() -> None:
    order: list[Any] = []
    shutter, lens, plates = (Step(name, order) for name in ("shutter", "lens", "plates"))
    field, burst = whole(fit(), 0.0), make_measurement(0).burst
    every: Any = Corrections(shutter=shutter, lens=lens, plates=plates)  # type: ignore[arg-type]
    assert every.applied(field, burst, "green") == (field, "of plates", "of lens")
    assert order == [("shutter", START), ("lens",), ("plates", burst, "green")]
    plain, of_plates, of_lens = Corrections().applied(field, burst, "green")
    assert (plain.measure, of_plates, of_lens) == ("green", None, None)
    straight, _, of_lens = Corrections(lens=lens).applied(field, burst, "hencky")  # type: ignore[arg-type]
    assert (straight.measure, of_lens) == ("hencky", "of lens")


class Tracker:
    """Gives one field for all bursts."""

    def __init__(self, field: StrainField) -> None:
        self.field, self.measured, self.renewed = field, list[int](), list[int]()

    def measure(self, burst: Any) -> StrainField:
        self.measured.append(burst.n)
        return self.field

    def renew_on_demand(self, burst: Any) -> None:
        self.renewed.append(burst.n)


def test_a_burst_is_corrected_measured_joined_to_its_force_and_guarded() -> None:
    loads = LoadLog(10.0)
    for k in range(5):
        loads.append(LoadSample(START + k / 10, 100.0 * k))
    now, checked = iter(range(100)), list[Any]()
    field = StrainField.from_values(GRID, {"dv_dy": 1e-3}, 1e-6)
    tracker: Any = Tracker(field)

    def sensor(burst: Any) -> Any:
        return SimpleNamespace(n=burst.n + 100)

    guard: Any = SimpleNamespace(check=lambda field, step: checked.append((field, step.t)))
    gauge = ZoiGauge("left", (GRID.x[1], GRID.y[1]))
    items = [make_measurement(1).burst, NewReference(make_measurement(2).burst), make_measurement(3).burst]
    found = list(
        measure(
            items, tracker, loads, corrections=Corrections(sensor), gauges=[gauge], strain="green", guards=[guard],
            timer=lambda: 0.25 * next(now),
        )
    )  # fmt: skip
    assert (tracker.measured, tracker.renewed) == ([108, 108], [108])
    assert [(m.number, m.force, m.time_step.measure_s, m.t) for m in found] == [
        (0, 100.0, 0.25, START + 0.1), (1, pytest.approx(300.0), 0.25, START + 0.3),
    ]  # fmt: skip
    assert [t for _, t in checked] == [m.t for m in found] and checked[0][0] is found[0].field
    assert found[0].field.measure == "green" and found[0].as_measured is field
    assert (
        found[0].time_step.gauges["left"].value == pytest.approx(1e-3, rel=1e-3) and found[0].plates is None
    )
