"""Guards: from which blur, strain, tilt and picture on they speak, and their words."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from acquire.events import Event
from analysis import Roi, StrainField, ZoiGrid
from analysis.field.uncertainty import PictureError
from hw_mocks.deformation import Affine
from hw_mocks.machine import Programme
from hw_mocks.optics import Optics, PlaneMotion
from hw_mocks.specimen import VirtualSpecimen
from live.cli import main
from live.pipeline.guards import (
    BlurGuard,
    DilatationGuard,
    PictureGuard,
    StrainGuard,
    TiltGuard,
    _usual_sigma,
    picture_words,
)
from live.pipeline.measurement import region_strains
from live.results import Strain
from tests.live.made_up import in_ascii, make_measurement
from tests.live.pipeline.test_reference import GRID, seen
from tests.live.shots import write_shots


def field(sigma_xx: float = 30e-6, sigma_yy: float = 40e-6, **values: float) -> StrainField:
    return StrainField.from_values(GRID, {"u": 0.0, **values}, {"du_dx": sigma_xx, "dv_dy": sigma_yy})


def test_the_cost_of_a_picture_is_of_both_directions() -> None:
    assert _usual_sigma(field()) == pytest.approx(50e-6 / math.sqrt(2))
    costly = replace(field(), picture=PictureError(2.0, (1.0, 4.0), "bands"))
    assert picture_words(costly).endswith("uncertain by 35 µm/m, usually 9 µm/m")
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
        blurred = replace(field(), picture=PictureError(factor, (1.0, 1.0), "blur"))
        for guard in (PictureGuard(events.append), BlurGuard(events.append)):
            guard.check(blurred, step)
        assert [event.source for event in events] == ["sharpness"], "it is told once"
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
    for measure in ("small", "hencky"):
        guard = StrainGuard(measure, events.append)  # type: ignore[arg-type]
        for _ in range(2):
            guard.check(field(**values), make_measurement(0).time_step)
    assert len(events) == told, "once, and of small strains alone"


def test_the_error_of_small_strains_is_half_the_squares_of_turn_and_strain() -> None:
    events: list[Event] = []
    StrainGuard("small", events.append).check(
        field(du_dy=-0.02, dv_dx=0.02, dv_dy=0.01), make_measurement(0).time_step
    )
    assert (
        "turned by 1.1 degrees, strained by 1.0%: small strains are off by about 248 µm/m" in events[0].text
    )
    assert events[0].data == {"rotation": pytest.approx(0.0199, rel=1e-3), "strain": pytest.approx(0.01)}


def test_small_strains_are_told_again_where_they_are_off_by_twice_as_much() -> None:
    events: list[Event] = []
    guard = StrainGuard("small", events.append)
    for turn in (0.035 * k / 19 for k in range(20)):
        guard.check(field(du_dy=-turn, dv_dx=turn), make_measurement(0).time_step)
    turns = [event.data["rotation"] for event in events]
    assert len(turns) == 4 and turns[-1] == pytest.approx(0.03, abs=0.005)


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
     (2e-3, 2e-3, 0.0, True), (-30e-6, -30e-6, 0.0, True)],
)  # fmt: skip
def test_strains_that_are_alike_are_told_beyond_their_noise(
    exx: float, eyy: float, sigma: float, told: bool
) -> None:
    events: list[Event] = []
    TiltGuard(None, events.append).check(field(), step_of(exx, eyy, sigma))
    assert [event.data["strain"] for event in events] == ([pytest.approx(exx)] if told else [])
    assert (
        not told
        or f"exx and eyy are alike, {exx * 1e6:.0f} um/m: as from motion by {abs(exx):.1e}"
        in in_ascii(events[0].text)
    )
    silent: list[Event] = []
    TiltGuard(None, silent.append, dilatation=False).check(field(), step_of(exx, eyy, sigma))
    assert silent == []


SHAPE, TURN, STRAIN, NU = (160, 192), math.radians(3), 0.01, 0.3


@pytest.fixture(scope="module")
def turned(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A strip pulled along y by 1 %, turned by 3 degrees on the way."""
    places = []
    for share in (0.0, 0.5, 1.0):
        c, s = math.cos(share * TURN), math.sin(share * TURN)
        F = np.array([[c, -s], [s, c]]) @ np.diag([1 - NU * share * STRAIN, 1 + share * STRAIN])
        places.append(Affine(0.0, 0.0, F[0, 0] - 1, F[0, 1], F[1, 0], F[1, 1] - 1, 96.0, 80.0))
    return write_shots(tmp_path_factory.mktemp("turned"), SHAPE, places)


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
    steps(events, 0.3, [(math.nan, math.nan), (500e-6 - 150e-6, -150e-6 - 150e-6)], None)
    steps(events, None, [(0.2e-3, 0.2e-3)])  # of an unknown ratio nothing is said
    assert len(events) == 1
    assert "−150 µm/m in both is as from motion away from the camera" in events[0].text


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
