"""The measure of strain is a setting; where small strains are not valid, a warning names another."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from acquire.events import Event
from analysis import Roi, StrainField, ZoiGrid
from hw_mocks.deformation import Affine
from hw_mocks.machine import Programme
from hw_mocks.optics import Optics, PlaneMotion
from hw_mocks.specimen import VirtualSpecimen
from hw_mocks.speckle import Speckle
from live.cli import main
from live.pipeline.guards import DilatationGuard, StrainGuard, TiltGuard
from live.pipeline.measurement import region_strains
from live.results import Strain
from tests.live.made_up import make_measurement

SHAPE, TURN, STRAIN, NU = (160, 192), math.radians(3), 0.01, 0.3


@pytest.fixture(scope="module")
def turned(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A strip pulled along y by 1 %, turned by 3 degrees on the way."""
    folder = tmp_path_factory.mktemp("turned")
    speckle = Speckle(SHAPE, radius=2.0, seed=3)
    for k, share in enumerate((0.0, 0.5, 1.0)):
        c, s = math.cos(share * TURN), math.sin(share * TURN)
        F = np.array([[c, -s], [s, c]]) @ np.diag([1 - NU * share * STRAIN, 1 + share * STRAIN])
        place = Affine(0.0, 0.0, F[0, 0] - 1, F[0, 1], F[1, 0], F[1, 1] - 1, 96.0, 80.0)
        cv2.imwrite(str(folder / f"a{k}.png"), np.rint(255 * speckle.render(place, SHAPE)).astype(np.uint8))
    return folder


@pytest.mark.parametrize(
    ("measure", "axial", "across"),
    [
        ("", STRAIN, -NU * STRAIN),
        ("engineering", STRAIN, -NU * STRAIN),
        ("small", math.cos(TURN) * (1 + STRAIN) - 1, math.cos(TURN) * (1 - NU * STRAIN) - 1),
        ("green", STRAIN + STRAIN**2 / 2, -NU * STRAIN + (NU * STRAIN) ** 2 / 2),
        ("hencky", math.log(1 + STRAIN), math.log(1 - NU * STRAIN)),
    ],
)
def test_every_file_is_in_the_measure_asked_for(
    turned: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture, measure: str, axial: float, across: float
) -> None:
    caplog.set_level("INFO", logger="live")
    arguments = ["--zoi", "48", "--step", "16", "--no-view", "--no-rrd", "--out", str(tmp_path / "out")]
    more = ["--strain", measure] if measure else []
    assert main(["replay", str(turned), *arguments, *more]) == 0
    with Strain.open(tmp_path / "out" / "strain.h5") as strain:
        assert strain.strain_measure == (measure or "engineering")
        assert strain.config["measure"]["strain"] == strain.strain_measure
        assert strain.values["eyy"][-1] == pytest.approx(axial, abs=3e-5)
        assert strain.values["exx"][-1] == pytest.approx(across, abs=3e-5)
        assert np.nanmean(strain.maps("eyy", -1)) == pytest.approx(axial, abs=3e-5)
        assert np.nanmean(strain.maps("dv_dy", -1)) == pytest.approx(
            math.cos(TURN) * (1 + STRAIN) - 1, abs=3e-5
        )
    row = (tmp_path / "out" / "strain.csv").read_text().splitlines()[-1].split(",")
    assert float(row[4]) == pytest.approx(axial, abs=3e-5)
    assert ("measure with --strain engineering" in caplog.text) is (measure == "small")


def field(**values: float) -> StrainField:
    return StrainField.from_values(ZoiGrid.cover(Roi(0, 0, 64, 64), 32, 16), values)


def test_the_warning_comes_once_for_an_error_and_only_for_small_strains() -> None:
    turned, pulled, calm = (
        field(du_dy=-0.01, dv_dx=0.01),
        field(dv_dy=0.021),
        field(dv_dy=0.019, du_dy=-0.005, dv_dx=0.005),
    )
    for measure, seen, times in (
        ("small", [calm, turned, turned, pulled], [2.0, 4.0]),
        ("small", [calm, pulled], [2.0]),
        ("small", [calm, calm], []),
        ("hencky", [turned, pulled], []),
    ):
        told: list[Event] = []
        guard = StrainGuard(measure, told.append)  # type: ignore[arg-type]
        for number, one in enumerate(seen):
            guard.check(one, replace(make_measurement(0).time_step, t=number + 1.0))
        assert [event.t for event in told] == times


def steps(
    events: list[Event], nu: float | None, strains: list[tuple[float, float]], stand_off: float | None = 500.0
) -> None:
    guard = DilatationGuard(nu, stand_off, events.append)
    for t, (exx, eyy) in enumerate(strains):
        sigmas = {"sigma_exx": 5e-6, "sigma_eyy": 5e-6}
        one = make_measurement(number=t)
        guard.check(one.field, replace(one.time_step, t=float(t), exx=exx, eyy=eyy, **sigmas))


def test_strains_that_do_not_fit_nu_are_motion_off_the_plane() -> None:
    events: list[Event] = []
    grown = [(k * (-0.33e-3 + 200e-6), k * (1e-3 + 200e-6)) for k in (0.1, 0.3, 0.6, 0.8)]
    steps(events, 0.33, grown)
    assert [(event.t, event.level) for event in events] == [(1.0, "warning")]
    assert events[0].data["strain"] == pytest.approx(0.3 * 200e-6, rel=1e-9)
    assert "60 µm/m in both is as from motion by 0.03 mm towards the camera" in events[0].text


def test_motion_away_along_x_without_a_distance() -> None:
    events: list[Event] = []
    steps(events, 0.3, [(500e-6 - 150e-6, -150e-6 - 150e-6)], None)
    assert "−150 µm/m in both is as from motion away from the camera" in events[0].text


@pytest.mark.parametrize(
    ("nu", "exx", "eyy"),
    [
        (0.33, -0.3e-3, 0.95e-3),  # a ratio of 0.316
        (None, 0.2e-3, 0.2e-3),
        (0.33, -0.9e-3, 2e-3),  # plastic flow
        (0.33, 30e-6, 20e-6),  # noise
        (0.33, math.nan, math.nan),
    ],
)
def test_no_warning_where_strains_may_be_right(nu: float | None, exx: float, eyy: float) -> None:
    events: list[Event] = []
    steps(events, nu, [(exx, eyy)])
    assert not events


def seen_by(optics: Optics, u: float = 0.0, sigma: float = 1e-3) -> StrainField:
    """What a perfect kernel measures of a plane that moves as ``optics`` say, in pictures of 640 x 480 px."""
    plane = VirtualSpecimen(width=640, height=480, programme=Programme(max_strain=1e-12))
    grid = ZoiGrid.cover(Roi(60, 60, 520, 360), 40, 20)
    seen, (x, y) = optics.seen(plane, plane.duration_s), np.meshgrid(grid.x, grid.y)
    (right, down), gradient = seen.displacement(x, y), seen.gradient(x, y)
    values = dict(zip(("du_dx", "du_dy", "dv_dx", "dv_dy"), gradient, strict=True))
    return StrainField.from_values(grid, {"u": right + u, "v": down, **values}, sigma)


def warned(one: StrainField, *, focal_px: float | None = 10_000.0, dilatation: bool = True) -> list[Event]:
    events: list[Event] = []
    guard = TiltGuard(focal_px, events.append, dilatation=dilatation)
    step = replace(make_measurement(number=1).time_step, **region_strains(one))
    for _ in range(2):  # warned of once
        guard.check(one, step)
    return events


def test_a_plane_that_comes_nearer_or_tilts_is_named_with_its_figures() -> None:
    nearer = warned(seen_by(Optics(500.0, settling=PlaneMotion(0.05))))
    assert len(nearer) == 1
    assert nearer[0].data["strain"] == pytest.approx(100e-6, rel=1e-2)
    assert "exx and eyy are alike, 100 µm/m: as from motion by 1.0e-04 of the stand-off" in nearer[0].text
    assert not warned(seen_by(Optics(500.0, settling=PlaneMotion(0.05))), dilatation=False)
    for axis, way, px in ((2, "from left to right", 480), (1, "from top to bottom", 320)):
        tilt = PlaneMotion(0.0, *(math.radians(0.2) * np.eye(2)[axis - 1]))
        (event,) = warned(seen_by(Optics(500.0, settling=tilt)))
        assert event.data["strain"] == pytest.approx(1.5 * math.radians(0.2) * px / 10_000, rel=2e-2)
        assert way in event.text
        assert "as from a tilt by 0.2 degrees" in event.text
    assert "by 0.2 degrees" not in warned(seen_by(Optics(500.0, settling=tilt)), focal_px=None)[0].text


def bent(load: float, kappa: float, nu: float = 0.3) -> StrainField:
    """Pulled along y by ``load`` and bent in its plane."""
    grid = ZoiGrid.cover(Roi(60, 60, 520, 360), 40, 20)
    x, y = np.meshgrid(grid.x - grid.x.mean(), grid.y - grid.y.mean())
    eyy = load + kappa * x
    v, u = eyy * y, -nu * (load * x + kappa * (x**2 - y**2) / 2) - kappa * y**2 / 2 * (1 - nu)
    values = {"u": u, "v": v, "dv_dy": eyy, "du_dx": -nu * eyy, "dv_dx": kappa * y, "du_dy": -kappa * y}
    return StrainField.from_values(grid, values, 1e-3)


@pytest.mark.parametrize(
    "one",
    [
        bent(5e-4, 0.0),
        bent(0.0, 1e-6),
        bent(5e-4, 1e-6),
        seen_by(Optics(500.0), 3.0),
        seen_by(Optics(5e4), sigma=0.5),
    ],
    ids=["pulled", "bent", "pulled and bent", "shifted", "noise"],
)
def test_load_bending_and_shift_are_no_motion_off_the_plane(one: StrainField) -> None:
    assert not warned(one)


def test_a_tilt_is_named_where_neither_load_nor_noise_may_have_made_it() -> None:
    """It rises by 250 um/m; a load makes exx and eyy differ by less, or by more, and the noise may be as much."""
    tilt = Optics(500.0, settling=PlaneMotion(0.0, math.radians(0.2)))
    tilted = seen_by(tilt)
    for load, named in ((1e-4, True), (4e-4, False)):
        loaded = replace(tilted, parameters=tilted.parameters + bent(load, 0.0).parameters)
        assert bool(warned(loaded)) == named, load
    assert not warned(seen_by(tilt, sigma=0.3))
