"""The specimen: material, programme, strain fields."""

from __future__ import annotations

import math

import numpy as np
import pytest

from acquire.addresses import parse_address
from acquire.errors import ConfigError
from hw_mocks.deformation import Affine, Deformation, SpecimenDeformation, Wave
from hw_mocks.machine import FlowCurve, PowerLaw, Programme, TestClock
from hw_mocks.specimen import VirtualSpecimen, specimen_from

DEFORMATIONS: dict[str, Deformation] = {
    "affine": Affine(0.3, -0.2, 0.01, 0.02, -0.03, 0.04, 100, 50),
    "rotation": Affine.rotation(0.4, 100, 50),
    "wave": Wave(0.5, 64),
    **{
        f"{kind} along {axis}": VirtualSpecimen(kind, axis=axis, rotation_rad=0.1, drift_px=(3, -2)).at(17.0)
        for kind in ("uniform", "hole", "woven")
        for axis in ("x", "y")
    },
    **{
        f"halves along {axis}": VirtualSpecimen("halves", axis=axis, second=FlowCurve(yield_stress=160e6)).at(
            17.0
        )
        for axis in ("x", "y")
    },
    **{
        f"neck along {axis}": VirtualSpecimen(
            axis=axis, neck_px=40.0, material=PowerLaw(0.2, 1.5), programme=Programme(max_strain=0.45)
        ).at(18.5)
        for axis in ("x", "y")
    },
}


@pytest.mark.parametrize("deformation", DEFORMATIONS.values(), ids=DEFORMATIONS.keys())
def test_gradient_is_that_of_the_displacement(deformation: Deformation) -> None:
    rng = np.random.default_rng(0)
    x, y, h = rng.uniform(0, 640, 400), rng.uniform(0, 512, 400), 1e-4
    far_x, far_y = deformation.displacement(x + h, y), deformation.displacement(x, y + h)
    near_x, near_y = deformation.displacement(x - h, y), deformation.displacement(x, y - h)
    differences = [
        (far - near) / (2 * h)
        for far, near in (
            (far_x[0], near_x[0]),
            (far_y[0], near_y[0]),
            (far_x[1], near_x[1]),
            (far_y[1], near_y[1]),
        )
    ]
    for difference, gradient in zip(differences, deformation.gradient(x, y), strict=True):
        np.testing.assert_allclose(difference, gradient, rtol=0, atol=2e-9)


def test_rotation_turns_x_towards_y() -> None:
    u, v = Affine.rotation(math.pi / 2).displacement(1.0, 0.0)
    assert (float(u), float(v)) == pytest.approx((-1.0, 1.0))


def test_uniform_field_has_the_mean_strains() -> None:
    specimen = VirtualSpecimen()
    du_dx, du_dy, dv_dx, dv_dy = specimen.gradient(*np.mgrid[0:640:50, 0:512:50], t=15.0)
    np.testing.assert_allclose(dv_dy, specimen.axial_strain(15.0))
    np.testing.assert_allclose(du_dx, specimen.transverse_strain(15.0))
    assert not du_dy.any() and not dv_dx.any()


def test_two_halves_flow_at_their_own_stress() -> None:
    specimen = specimen_from(parse_address("sim:halves?seconds=20"))
    y, t = [40.0, 470.0], np.linspace(2, 20, 400)
    stress = specimen.stress(t)
    assert stress.max() > 165e6
    for seconds, one in zip(t, stress, strict=True):
        du_dx, _, _, dv_dy = specimen.gradient([320.0, 320.0], y, seconds)
        for k, flow in enumerate((120e6, 160e6)):
            metal = FlowCurve(yield_stress=flow)
            assert float(metal.stress(dv_dy[k])) == pytest.approx(one, rel=1e-9, abs=1.0)
            assert du_dx[k] == pytest.approx(float(metal.transverse(dv_dy[k])), abs=1e-9)
            assert (dv_dy[k] > one / metal.E * (1 + 1e-9)) == (one > flow * (1 + 1e-9))
    other = specimen_from(parse_address("sim:halves?yield_MPa=50&yield2_MPa=70"))
    assert other.material.yield_stress == 50e6 and other.second is not None
    assert other.second.yield_stress == 70e6
    for address in ("sim:woven?yield2_MPa=150", "sim:halves?n=0.2"):
        with pytest.raises(ConfigError, match="yield2_MPa is of sim:halves"):
            specimen_from(parse_address(address))


def test_a_neck_grows_from_the_highest_force_on_while_the_rest_rests() -> None:
    metal = PowerLaw(0.2, 1.5)
    specimen = VirtualSpecimen(neck_px=40.0, material=metal, programme=Programme(max_strain=0.45))
    strain = np.linspace(0.1, 0.4, 30001)
    assert metal.uniform_strain == pytest.approx(strain[np.argmax(metal.stress(strain))], abs=2e-5)
    middle = 0.2 * 512 + 511 / 2
    at_end = specimen.gradient([320, 320], [middle, 0], 20.0)
    assert at_end[3] == pytest.approx([0.45, metal.uniform_strain], abs=1e-5)
    assert at_end[0][0] == pytest.approx(float(metal.transverse(0.45)))
    assert specimen.force(20.0) == pytest.approx(40e-6 * float(metal.stress(0.45)))
    assert specimen.force(20.0) < specimen.area_m2 * float(metal.stress(metal.uniform_strain))
    with pytest.raises(ConfigError, match="a neck needs sim:uniform of a sheet metal; give n or r"):
        specimen_from(parse_address("sim:uniform?neck=40"))


def test_hole_has_kirschs_concentration() -> None:
    specimen = VirtualSpecimen("hole")
    motion, modes = specimen.at(10.0), specimen.modes
    beside = motion.gradient(modes.x0 + modes.hole_radius, modes.y0)
    above = motion.gradient(modes.x0, modes.y0 + modes.hole_radius)
    assert beside[3] / motion.axial == pytest.approx(3)
    assert above[0] / motion.axial == pytest.approx(-1)
    far = motion.gradient(modes.x0 + 1e5, modes.y0 + 1e5)
    assert far[3] / motion.axial == pytest.approx(1, abs=1e-5)
    assert far[0] / motion.axial == pytest.approx(-specimen.nu, abs=1e-5)


def test_hole_edge_carries_no_traction() -> None:
    specimen = VirtualSpecimen("hole")
    angle = np.linspace(0, 2 * math.pi, 37)
    nx, ny, modes = np.cos(angle), np.sin(angle), specimen.modes
    x, y = modes.x0 + modes.hole_radius * nx, modes.y0 + modes.hole_radius * ny
    du_dx, du_dy, dv_dx, dv_dy = specimen.gradient(x, y, 10.0)
    nu = specimen.nu
    sx, sy = du_dx + nu * dv_dy, dv_dy + nu * du_dx
    sxy = (1 - nu) / 2 * (du_dy + dv_dx)
    scale = float(specimen.axial_strain(10.0))
    np.testing.assert_allclose((sx * nx + sxy * ny) / scale, 0, atol=1e-9)
    np.testing.assert_allclose((sxy * nx + sy * ny) / scale, 0, atol=1e-9)


def test_mask_is_the_hole() -> None:
    mask = VirtualSpecimen("hole", hole_radius_px=40).mask()
    assert mask.shape == (512, 640)
    assert np.count_nonzero(~mask) == pytest.approx(math.pi * 40**2, rel=0.01)
    assert VirtualSpecimen("woven").mask().all()


def test_woven_mean_over_a_cell_is_the_mean_strain() -> None:
    specimen = VirtualSpecimen("woven", cell_px=96)
    y, x = np.mgrid[96:192, 192:288]
    du_dx, _, _, dv_dy = specimen.gradient(x, y, 12.0)
    assert dv_dy.mean() == pytest.approx(float(specimen.axial_strain(12.0)), rel=1e-12)
    assert du_dx.mean() == pytest.approx(float(specimen.transverse_strain(12.0)), rel=1e-12)
    assert dv_dy.max() / dv_dy.mean() == pytest.approx(1.6, abs=0.01)


def test_material_is_elastic_up_to_yield() -> None:
    material = FlowCurve()
    assert material.yield_strain == pytest.approx(2e-3)
    strain = np.linspace(-material.yield_strain, material.yield_strain, 20)
    np.testing.assert_allclose(material.stress(strain), material.E * strain)
    np.testing.assert_allclose(material.transverse(strain), -material.nu * strain)


def test_material_beyond_yield_is_on_its_flow_curve() -> None:
    material = FlowCurve(hardening=10e9)
    strain = np.linspace(material.yield_strain, 0.1, 50)
    plastic = material.plastic_strain(strain)
    flow = (
        material.yield_stress
        + material.voce * (1 - np.exp(-material.voce_rate * plastic))
        + material.hardening * plastic
    )
    np.testing.assert_allclose(material.stress(strain), flow, rtol=1e-12)
    np.testing.assert_allclose(
        material.transverse(strain), -material.nu * flow / material.E - plastic / 2, rtol=1e-12
    )


def test_programme_holds_pulls_and_holds() -> None:
    p = Programme(hold_s=2, ramp_s=10, end_s=1, knee_strain=2e-3, max_strain=8e-3, knee=0.6)
    assert p.duration_s == 13
    np.testing.assert_allclose(
        p.strain([-1, 0, 2, 5, 8, 10, 12, 13]), [0, 0, 0, 1e-3, 2e-3, 5e-3, 8e-3, 8e-3]
    )


def test_default_test_is_twenty_seconds_and_yields_at_six_tenths_of_the_ramp() -> None:
    specimen = specimen_from(parse_address("sim:"))
    p = specimen.programme
    assert specimen.duration_s == pytest.approx(20)
    assert (specimen.yield_s - p.hold_s) / p.ramp_s == pytest.approx(0.6)
    assert float(specimen.force(specimen.yield_s)) == pytest.approx(140e6 * 40e-6)


def test_drift_and_rotation_are_reached_at_the_end_of_the_ramp() -> None:
    specimen = VirtualSpecimen(drift_px=(2.0, -1.0), rotation_rad=0.02)
    x0, y0 = specimen.modes.x0, specimen.modes.y0
    u, v = specimen.displacement(x0, y0, specimen.duration_s)
    assert (float(u), float(v)) == pytest.approx((2.0, -1.0))
    assert specimen.at(1.0) == SpecimenDeformation(specimen.modes, 0.0, 0.0)
    assert specimen.at(20.0).angle == 0.02


def test_clock_begins_once() -> None:
    clock = TestClock()
    assert clock.start is None and clock.elapsed(7.0) == 0
    assert clock.begin(5.0) == 5 and clock.begin(6.0) == 5
    assert clock.elapsed(7.0) == 2


@pytest.mark.parametrize(
    ("address", "word"),
    [
        ("sim:cracked", "uniform, hole, woven"),
        ("sim:?width=10", "width=10"),
        ("sim:?seconds=2&hold=2", "seconds above"),
        ("sim:?nu=0.7", "nu=0.7"),
    ],
)
def test_bad_address_says_what_is_allowed(address: str, word: str) -> None:
    with pytest.raises(ConfigError, match=word):
        specimen_from(parse_address(address))


def test_a_power_law_has_its_exponent_and_its_anisotropy() -> None:
    metal = PowerLaw(0.2, 1.6)
    strain = np.linspace(0.01, 0.3, 30)
    true_stress, plastic = metal.stress(strain) * (1 + strain), metal.plastic_strain(strain)
    np.testing.assert_allclose(np.diff(np.log(true_stress)) / np.diff(np.log(plastic)), 0.2, rtol=1e-9)
    np.testing.assert_allclose(np.log1p(strain), plastic + true_stress / metal.E, rtol=1e-12)
    width = np.log1p(metal.transverse(strain)) + metal.nu * true_stress / metal.E
    np.testing.assert_allclose(width / (-plastic - width), 1.6, rtol=1e-9)
    below = np.linspace(0, 0.99 * metal.yield_strain, 9)
    np.testing.assert_allclose(metal.stress(below) * (1 + below), metal.E * np.log1p(below), rtol=1e-12)
    assert specimen_from(parse_address("sim:uniform?n=0.2&r=1.6&max_strain=0.3")).material == metal


def test_an_address_has_the_units_of_its_keys() -> None:
    text = (
        "sim:uniform?E_GPa=200&nu=0.3&yield_MPa=300&section_mm2=50&px_per_mm=12.5&rotation_deg=45"
        "&seconds=10&hold=3&end=2&max_strain=0.02&axis=x&drift_x=4&drift_y=-3"
    )
    specimen = specimen_from(parse_address(text))
    assert (specimen.E, specimen.nu, specimen.material.yield_strain) == pytest.approx((200e9, 0.3, 1.5e-3))
    assert (specimen.area_m2, specimen.px_per_m) == pytest.approx((50e-6, 12.5e3))
    assert specimen.rotation_rad == pytest.approx(math.pi / 4)
    assert specimen.drift_px == (4.0, -3.0) and specimen.axis == "x"
    p = specimen.programme
    assert (p.hold_s, p.ramp_s, p.end_s, p.max_strain) == pytest.approx((3, 5, 2, 0.02))


def test_a_test_that_stays_elastic_pulls_evenly_and_never_yields() -> None:
    specimen = specimen_from(parse_address("sim:?seconds=10&hold=0&end=0&max_strain=1e-3"))
    assert specimen.yield_s == math.inf
    assert specimen.axial_strain([0.0, 2.5, 5.0, 10.0]) == pytest.approx([0, 2.5e-4, 5e-4, 1e-3])
    assert float(specimen.force(5.0)) == pytest.approx(70e9 * 5e-4 * 40e-6)


def test_the_strains_of_a_neck_fall_off_from_its_middle() -> None:
    """sech^2 of the distance over its width, along and across the load, in the lower part of the picture."""
    metal = PowerLaw(0.2, 1.5)
    specimen = VirtualSpecimen(neck_px=40.0, material=metal, programme=Programme(max_strain=0.45))
    middle, off = 0.2 * 512 + 511 / 2, np.array([0.0, 40.0, -40.0])
    du_dx, _, _, dv_dy = specimen.gradient(np.full(3, 319.5), middle + off, 20.0)
    share = 1 / np.cosh(off / 40.0) ** 2
    most = 0.45 - metal.uniform_strain
    assert dv_dy == pytest.approx(metal.uniform_strain + most * share, rel=1e-9)
    across = [float(metal.transverse(one)) for one in (metal.uniform_strain, 0.45)]
    assert du_dx == pytest.approx(across[0] + (across[1] - across[0]) * share, rel=1e-9)


def test_cycles_keep_their_forces_while_the_stiffness_falls() -> None:
    specimen = specimen_from(
        parse_address("sim:?programme=cyclic&hz=2&r=0.1&n=5&fall=0.2&hold=1&E_GPa=70&section_mm2=10")
    )
    assert specimen.duration_s == pytest.approx(1 + 2.5 + 0.5)
    valleys, peaks = 1 + np.arange(5) / 2, 1.25 + np.arange(5) / 2
    assert specimen.force(0.0) == specimen.axial_strain(0.0) == 0
    assert specimen.force(peaks) == pytest.approx(700.0)
    assert specimen.force([*valleys, 3.5, 4.0]) == pytest.approx(70.0)
    stiffness = 70e9 * (1 - 0.05 * np.arange(5))
    assert specimen.stress(peaks) / specimen.axial_strain(peaks) == pytest.approx(stiffness)
    t = np.linspace(0, 4, 4001)
    assert specimen.force(t).max() <= 700.0 + 1e-6 and specimen.force(t).min() >= 0


@pytest.mark.parametrize(
    ("kind", "settings", "words"),
    [
        ("", "max_strain=2e-3&fall=0.1", "elastic"),
        ("", "hold=0", "hold"),
        ("", "n=0", "n"),
        ("halves", "n=5", "halves are pulled"),
    ],
)
def test_impossible_cycles_are_refused(kind: str, settings: str, words: str) -> None:
    from hw_mocks.sim_camera import open_sim_camera

    address = parse_address(f"sim:{kind}?programme=cyclic&{settings}")
    with pytest.raises(ConfigError, match=words):
        open_sim_camera(address, lambda event: None, specimen_from(address))
