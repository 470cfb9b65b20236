"""The view of the simulated camera against closed forms of projection, distortion and rolling shutter."""

from __future__ import annotations

import math

import numpy as np
import pytest

from acquire.addresses import Options, parse_address
from acquire.errors import ConfigError
from hw_mocks.deformation import Affine
from hw_mocks.optics import Optics, PlaneMotion, RolledShutter, take_optics
from hw_mocks.scene import Scene
from hw_mocks.specimen import VirtualSpecimen

SPECIMEN = VirtualSpecimen(width=201, height=161)  # 20 px/mm
END = SPECIMEN.duration_s
X0, Y0 = 100.0, 80.0


def seen(optics: Optics, x: float, y: float, t: float = END) -> tuple[float, float]:
    """Where a place of an unstrained specimen is seen, px from the middle."""
    unloaded = VirtualSpecimen(width=201, height=161)
    away = optics.seen(unloaded, t)
    strain, across = float(unloaded.axial_strain(t)), float(unloaded.transverse_strain(t))
    x, y = x / (1 + across), y / (1 + strain)  # so that the strained place is (x, y)
    u, v = away.displacement(X0 + x, Y0 + y)
    return float(u) + x, float(v) + y


def test_motion_towards_the_camera_scales_by_the_distance() -> None:
    x, y = seen(Optics(500.0, settling=PlaneMotion(0.1)), 60, -40)
    assert (x, y) == pytest.approx((60 * 500 / 499.9, -40 * 500 / 499.9), abs=1e-9)


def test_tilt_projects_the_turned_plane() -> None:
    angle, away = math.radians(2.0), 500 * 20.0
    x, y = seen(Optics(500.0, settling=PlaneMotion(0, 0, angle)), 60, -40)
    depth = 1 - 60 * math.sin(angle) / away
    assert (x, y) == pytest.approx((60 * math.cos(angle) / depth, -40 / depth), abs=1e-9)


def test_settling_grows_with_the_load_and_not_with_time() -> None:
    early = SPECIMEN.programme.hold_s + 1.0
    share = float(SPECIMEN.force(early) / SPECIMEN.force(END))
    assert 0.01 < share < 0.5
    x, _ = seen(Optics(500.0, settling=PlaneMotion(0.1)), 60, 0, early)
    assert x == pytest.approx(60 / (1 - share * 0.1 / 500), abs=1e-9)


def test_distortion_is_a_share_of_the_radius_at_the_corner() -> None:
    x, y = seen(Optics(distortion=0.003), X0, Y0, 0.0)
    assert (x, y) == pytest.approx((1.003 * X0, 1.003 * Y0), abs=1e-9)
    x, _ = seen(Optics(distortion=0.003), 0.5 * math.hypot(X0, Y0), 0, 0.0)
    assert x == pytest.approx(0.5 * math.hypot(X0, Y0) * (1 + 0.003 / 4), abs=1e-9)


@pytest.mark.parametrize("rolled", [0.0, 0.5])
def test_gradient_is_the_derivative_of_the_displacement(rolled: float) -> None:
    optics = Optics(
        100.0,
        0.01,
        PlaneMotion(0, 0.05, -0.02),
        PlaneMotion(1.0, 0.02, 0.03),
        readout_s=rolled,
        plates=((0, 0, 1, 1),),
    )
    deformation = optics.seen(SPECIMEN, 8.0)
    x, y, h = np.array([20.0, 90, 180]), np.array([30.0, 100, 140]), 1e-4
    a, b, c, d = deformation.gradient(x, y)
    (u1, v1), (u0, v0) = deformation.displacement(x + h, y), deformation.displacement(x - h, y)
    np.testing.assert_allclose([a, c], [(u1 - u0) / 2 / h, (v1 - v0) / 2 / h], atol=2e-8)
    (u1, v1), (u0, v0) = deformation.displacement(x, y + h), deformation.displacement(x, y - h)
    np.testing.assert_allclose([b, d], [(u1 - u0) / 2 / h, (v1 - v0) / 2 / h], atol=2e-8)


def test_plates_share_the_rigid_motion_only() -> None:
    specimen = VirtualSpecimen(width=201, height=161, drift_px=(3.0, -2.0))
    u, v = Optics(plates=((10, 20, 30, 40),)).seen(specimen, END).displacement([20.0, 100.0], [30.0, 120.0])
    assert (u[0], v[0]) == pytest.approx((3.0, -2.0), abs=1e-12)
    assert v[1] == pytest.approx(-2.0 + 40 * 8e-3, abs=1e-9)
    _, clamped = (
        Optics(plates=((10, 20, 30, 40),), plate_strain=0.5).seen(specimen, END).displacement(20.0, 30.0)
    )
    assert float(clamped) == pytest.approx(-2.0 - 50 * 0.5 * 8e-3, abs=1e-9)


def test_a_rolling_shutter_shows_velocity_as_strain() -> None:
    # 10 px/s, 33 ms, 1001 lines: 330 um/m, and 2 px/s across shear it by 66 um/m.
    rolled = RolledShutter(lambda t: Affine(2.0 * t, 10.0 * t), 0.0, 0.033, 1001)
    _, b, _, d = rolled.gradient([5.0, 7.0], [0.0, 900.0])
    np.testing.assert_allclose(d, 330e-6, rtol=4e-4)
    np.testing.assert_allclose(b, 66e-6, rtol=4e-4)
    u, v = rolled.displacement(0.0, 1000.0)
    assert (float(u), float(v)) == pytest.approx((0.033, 0.165), rel=1e-3)


def test_the_back_sees_the_motion_from_behind() -> None:
    moved = PlaneMotion(0.1, 0.001, 0.002)
    front = seen(Optics(500.0, settling=moved), 50, 30)
    back = seen(Optics(500.0, settling=moved, behind=True), -50, 30)
    # The same place is nearer by what it was farther from the other side.
    assert back[0] / -50 - 1 == pytest.approx(-(front[0] / 50 - 1), abs=8e-6)
    assert front[1] / 30 - 1 == pytest.approx(200e-6 + 13e-6, abs=8e-6)
    assert back[1] / 30 - 1 == pytest.approx(-213e-6, abs=8e-6)


def test_the_sides_of_a_bent_specimen_differ_from_the_mean_by_as_much() -> None:
    specimen = VirtualSpecimen(width=201, height=161)
    sides = [Optics(bending=0.05, behind=behind).seen(specimen, END) for behind in (False, True)]
    front, back = ([float(gradient) for gradient in side.gradient(30.0, 40.0)] for side in sides)
    axial, across = float(specimen.axial_strain(END)), float(specimen.transverse_strain(END))
    assert (front[3], back[3]) == pytest.approx((1.05 * axial, 0.95 * axial), rel=1e-12)
    assert (front[0], back[0]) == pytest.approx((1.05 * across, 0.95 * across), rel=1e-12)


def test_the_picture_is_that_of_the_exact_road() -> None:
    optics = Optics(500.0, 0.003, PlaneMotion(0, 0.01, 0.01), PlaneMotion(0.1, 0.002, 0.002), readout_s=0.03)
    scene = Scene(VirtualSpecimen(width=96, height=80), optics=optics)
    np.testing.assert_allclose(scene.render(8.0), scene.exact(8.0), atol=3e-4)


def test_all_keys_of_an_address() -> None:
    keys = "stand_off_mm=500&distortion=0.3&tilt_x_deg=1&tilt_y_deg=2&settle_mm=0.1&settle_x_deg=3&settle_y_deg=4"
    options = Options(
        parse_address(
            f"sim:?{keys}&plates=1,2,3,4;5,6,7,8&plate_strain=0.5&readout_ms=33&side=back&bending=3&flicker=8&lamp_hz=120"
        )
    )
    found = take_optics(options)
    options.done()
    one, two, three, four = (math.radians(angle) for angle in (1, 2, 3, 4))
    assert found == Optics(
        500.0, 0.003, PlaneMotion(0, one, two), PlaneMotion(0.1, three, four), ((1, 2, 3, 4), (5, 6, 7, 8)),
        plate_strain=0.5, readout_s=0.033, behind=True, bending=0.03, flicker=0.08, lamp_Hz=120,
    )  # fmt: skip


def test_lamps_light_each_line_as_it_is_read() -> None:
    """At 100 Hz and 10 ms of readout one swing stands in the picture, brightest at its middle line."""
    optics = Optics(flicker=0.1, readout_s=0.01)
    assert optics.light(0.0, 5)[:, 0] == pytest.approx([0.9, 1.0, 1.1, 1.0, 0.9])
    assert optics.light(0.0025, 5)[:, 0] == pytest.approx([1.0, 1.1, 1.0, 0.9, 1.0])
    assert optics.light(0.0, 2)[:, 0] == pytest.approx([0.9, 0.9])
    quick = Optics(flicker=0.1, readout_s=0.004)
    ends = 1 + 0.1 * math.cos(0.4 * math.pi)
    assert quick.light(0.0, 3)[:, 0] == pytest.approx([ends, 1.1, ends])
    at_once = Optics(flicker=0.2, lamp_Hz=50)
    assert at_once.light(0.005, 3)[:, 0] == pytest.approx([1.0] * 3)
    assert at_once.light(0.010, 3)[:, 0] == pytest.approx([0.8] * 3)


def test_the_picture_has_the_light_of_its_lamp() -> None:
    specimen = VirtualSpecimen(width=96, height=80)
    flickering = Optics(500.0, flicker=0.1, readout_s=0.01)
    steady = Optics(500.0, readout_s=0.01, flicker=1e-12)
    ratio = Scene(specimen, optics=flickering).render(8.0) / Scene(specimen, optics=steady).render(8.0)
    np.testing.assert_allclose(ratio, np.broadcast_to(flickering.light(8.0, 80), ratio.shape), rtol=1e-5)


@pytest.mark.parametrize(
    "plate", ["1,2,3", "0,0,0,5", "a,b,c,d", "1,2,3,0", "1,2,0,4", "1,2,-3,4", "1,2,3,4,5", "1,2,3,4;5"]
)
def test_a_plate_has_four_numbers_and_an_area(plate: str) -> None:
    with pytest.raises(ConfigError, match=f"plates={plate} is not possible; allowed: x,y,width,height"):
        take_optics(Options(parse_address(f"sim:?plates={plate}")))


def test_the_edges_of_a_plate_and_what_is_seen_from_behind() -> None:
    specimen = VirtualSpecimen(width=201, height=161, drift_px=(3.0, -2.0))
    seen_by = Optics(plates=((10, 20, 30, 40),)).seen(specimen, END)
    _, v = seen_by.displacement([10.0, 39.9, 40.0, 20.0, 20.0, 9.9], [20.0, 30.0, 30.0, 59.9, 60.0, 30.0])
    on_plate = np.abs(v + 2.0) < 1e-9
    assert on_plate.tolist() == [True, True, False, True, False, False]
    u, v = Optics(behind=True).seen(specimen, END).displacement(X0, Y0)
    assert (float(u), float(v)) == pytest.approx((-3.0, -2.0), abs=1e-9)


def test_motion_that_speeds_up_within_a_readout_is_followed() -> None:
    """8 t^2 px, read from -0.5 s to 0.5 s: 2 px at either end and none in the middle; and its slope is shear."""
    rolled = RolledShutter(lambda t: Affine(8.0 * t * t, 0.0), 0.0, 1.0, 101)
    u, _ = rolled.displacement(0.0, [0.0, 25.0, 50.0, 100.0])
    assert u == pytest.approx([2.0, 0.5, 0.0, 2.0])
    _, b, _, _ = rolled.gradient(0.0, [0.0, 50.0, 100.0])
    assert b == pytest.approx([-0.08, 0.0, 0.08])
