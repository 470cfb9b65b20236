"""What the settings of simulated devices may be, and what they are where nobody says anything."""

from __future__ import annotations

import math

import pytest

from acquire.addresses import Options, parse_address
from acquire.errors import ConfigError
from acquire.events import ignore_event
from acquire.settings import settings_of
from hw_mocks.machine import FlowCurve, PowerLaw
from hw_mocks.optics import Optics, take_optics
from hw_mocks.scene import MemorySettings, Sensor, open_memory_camera, take_sensor
from hw_mocks.sim_camera import SimCameraSettings, open_sim_camera
from hw_mocks.sim_load_cell import SimLoadSettings, open_sim_load
from hw_mocks.sim_settings import CAMERA_FAULTS, SERIAL_FAULTS, SPECIMEN_KEYS, SimSettings
from hw_mocks.specimen import VirtualSpecimen, specimen_from, take_specimen

SPECIMEN = {
    "width": "a whole number from 32 to 8192",
    "height": "a whole number from 32 to 8192",
    "E_GPa": "a number from 0.001",
    "nu": "a number from 0 to 0.5",
    "yield_MPa": "a number from 0.001",
    "yield2_MPa": "a number from 0.001",
    "n": "a number from 0.01 to 0.9",
    "r": "a number from 0.05 to 10",
    "seconds": "a number from 0.1",
    "hold": "a number from 0",
    "end": "a number from 0",
    "max_strain": "a number from 0 to 0.5",
    "axis": "one of y, x",
    "section_mm2": "a number from 0.001",
    "px_per_mm": "a number from 0.001",
    "hole": "a number from 4",
    "cell": "a number from 8",
    "overstrain": "a number from 0 to 0.95",
    "neck": "a number from 4 to 8192",
    "drift_x": "a number",
    "drift_y": "a number",
    "rotation_deg": "a number from -45 to 45",
    "lockstep": "yes or no",
    "machine": "a whole number from 0 to 65535",
    "waits": "yes or no",
    "programme": "one of pull, cyclic",
}
CYCLIC = {
    "hz": "a number from 0.0001 to 1000",
    "n": "a whole number from 1",
    "r": "a number from -10 to 0.99",
    "fall": "a number from 0 to 0.9",
    "hold": "a number from 0.1",
    "end": "a number from 0",
    "max_strain": "a number from 0 to 0.5",
    "seconds": "a number from 0.1",
}
CAMERA = {
    "bits": "one of 8, 10, 12, 16",
    "noise": "a number from 0 to 20",
    "fpn": "a number from 0 to 20",
    "brightness": "a number from 0.01 to 10",
    "fps": "a number from 0.1 to 10000",
    "radius": "a number from 0.7 to 64",
    "contrast": "a number from 1 to 20",
    "seed": "a whole number from 0",
    "buffers": "a whole number from 1 to 1000",
    "offset": "a number from 0",
    "stand_off_mm": "a number from 1",
    "distortion": "a number from -10 to 10",
    **dict.fromkeys(("tilt_x_deg", "tilt_y_deg", "settle_x_deg", "settle_y_deg"), "a number from -30 to 30"),
    "plate_strain": "a number from -1 to 2",
    "readout_ms": "a number from 0 to 1000",
    "flicker": "a number from 0 to 50",
    "lamp_hz": "a number from 1 to 100000",
    "side": "one of front, back",
    "bending": "a number from -100 to 100",
}
LOAD = {
    "rate": "a number from 0.1 to 1000",
    "noise_N": "a number from 0",
    "resolution_N": "a number from 1e-06",
    "range_N": "a number from 0.001",
    "weight_N": "a number",
    "line": "one of millis, plain, label, openscale",
    "seed": "a whole number from 0",
}
MEMORY = {
    "width": "a whole number from 64 to 8192",
    "height": "a whole number from 64 to 8192",
    "bits": "one of 8, 10, 12",
    "fps": "a number from 0.1 to 10000",
    "seconds": "a number from 0.1",
    "pictures": "a whole number from 4 to 1000",
    "buffers": "a whole number from 1 to 1000",
    "saturated": "a number from 0 to 0.5",
}


def refusal(device: str, setting: str) -> str:
    """What an opener says to be allowed in place of this setting."""
    address = parse_address(f"sim:?{setting}")
    with pytest.raises(ConfigError) as caught:
        if device == "specimen":
            take_specimen(Options(address))
        elif device == "camera":
            open_sim_camera(address, ignore_event, VirtualSpecimen())
        elif device == "load":
            open_sim_load(address, ignore_event, VirtualSpecimen())
        else:
            open_memory_camera(address)
    return str(caught.value).partition(" is not possible; allowed: ")[2]


TABLES = {"specimen": SPECIMEN, "camera": CAMERA, "load": LOAD, "memory": MEMORY}


@pytest.mark.parametrize(
    ("device", "key", "allowed"),
    [(device, key, allowed) for device, table in TABLES.items() for key, allowed in table.items()],
)
def test_an_impossible_value_is_refused_with_what_is_allowed(device: str, key: str, allowed: str) -> None:
    assert refusal(device, f"{key}=nonsense") == allowed


def test_bounds_that_follow_from_other_settings() -> None:
    """The exposure ends with the frame; a specimen comes no nearer than half of its distance."""
    assert refusal("camera", "fps=50&exposure_us=20001") == "a number from 0 to 20000"
    assert refusal("camera", "stand_off_mm=300&settle_mm=151") == "a number from -150 to 150"
    assert {*SPECIMEN, *CYCLIC} == SPECIMEN_KEYS
    cycles = {key: CYCLIC[key] for key in ("hz", "fall")}
    further = {"settle_mm": "a number", "exposure_us": "a number from 0"}
    declared = {one.key: one.allowed for one in settings_of(SimSettings) if one.allowed}
    assert declared == SPECIMEN | cycles | CAMERA | further
    for key, allowed in CYCLIC.items():
        assert refusal("camera", f"programme=cyclic&{key}=nonsense") == allowed


def test_a_specimen_of_which_nothing_is_said() -> None:
    found = specimen_from(parse_address("sim:"))
    assert (found.kind, found.width, found.height, found.axis, found.nominal) == (
        "uniform", 640, 512, "y", False,
    )  # fmt: skip
    assert found.material == FlowCurve(70e9, 0.33, 140e6, 60e6, 300.0, 1e9)
    assert (found.area_m2, found.px_per_m) == pytest.approx((40e-6, 20e3))
    assert (found.hole_radius_px, found.cell_px, found.overstrain, found.neck_px) == (60, 96, 0.6, 0)
    assert (found.drift_px, found.rotation_rad, found.programme.machine) == ((0.0, 0.0), 0.0, None)


@pytest.mark.parametrize(
    ("setting", "n", "r"), [("n=0.3", 0.3, 1.0), ("r=2", 0.2, 2.0), ("n=0.1&r=0.5", 0.1, 0.5)]
)
def test_sheet_metal_is_what_has_an_exponent_or_an_anisotropy(setting: str, n: float, r: float) -> None:
    assert specimen_from(parse_address(f"sim:?{setting}")).material == PowerLaw(n, r, 70e9, 0.33, 140e6)


@pytest.mark.parametrize(
    ("setting", "hold", "end", "knee_strain", "knee"),
    [
        ("seconds=10", 1.0, 0.5, 2e-3, 0.6),
        ("seconds=300", 2.0, 1.0, 2e-3, 0.6),
        ("seconds=20&max_strain=0.002", 2.0, 1.0, 1e-3, 0.5),  # just not beyond yield
        ("seconds=20&yield_MPa=70", 2.0, 1.0, 1e-3, 0.6),
    ],
)
def test_a_short_test_keeps_its_parts_in_proportion(
    setting: str, hold: float, end: float, knee_strain: float, knee: float
) -> None:
    p = specimen_from(parse_address(f"sim:?{setting}")).programme
    assert (p.hold_s, p.end_s, p.knee_strain, p.knee) == pytest.approx((hold, end, knee_strain, knee))


def test_a_camera_of_which_nothing_is_said() -> None:
    options = Options(parse_address("sim:"))
    assert take_optics(options) == Optics() and Optics().plain
    assert Optics().lamp_Hz == 100 and not Optics(flicker=0.01).plain
    assert take_sensor(options) == Sensor.with_noise(12, 0.005)
    plain = SimCameraSettings(Sensor())
    assert (plain.fps, plain.exposure_s, plain.radius_px, plain.contrast) == (60, 0.002, 2, 0.18)
    with open_sim_camera(
        parse_address("sim:?lockstep=yes"), ignore_event, VirtualSpecimen(nominal=True)
    ) as one:
        assert (one.info.fps, one.info.exposure_s, one.info.bits) == (60, pytest.approx(2e-3), 12)
        shown = one.info.controls
        assert (shown["speckle_radius_px"], shown["contrast"], shown["buffers"]) == (2, 0.18, 4)
        assert (shown["seed"], shown["brightness"], shown["fixed_pattern"]) == (0, 1, 0)


@pytest.mark.parametrize(("fps", "exposure_us"), [(60, 2000), (250, 2000), (500, 1000), (1000, 500)])
def test_the_exposure_is_half_a_period_at_most(fps: int, exposure_us: float) -> None:
    address = parse_address(f"sim:?width=64&height=48&fps={fps}&lockstep=yes")
    with open_sim_camera(address, ignore_event, specimen_from(address)) as camera:
        assert camera.info.exposure_s == pytest.approx(exposure_us * 1e-6)


def test_a_load_cell_and_a_memory_camera_of_which_nothing_is_said() -> None:
    plain = SimLoadSettings()
    assert (plain.protocol, plain.line, plain.rate, plain.noise_N) == ("ascii", "millis", 80, 1)
    assert (plain.resolution_N, plain.range_N, plain.weight_N, plain.seed) == (0.1, 10_000, 0, 0)
    with open_sim_load(parse_address("sim:"), ignore_event, VirtualSpecimen(nominal=True)) as cell:
        stated = cell.info.settings
    assert stated["noise_N"] == pytest.approx(math.sqrt(1 + 0.1**2 / 12))
    assert (stated["rate"], stated["resolution_N"], stated["simulated_capacity_N"]) == (80, 0.1, 10_000)
    memory = MemorySettings()
    assert (memory.width, memory.height, memory.bits, memory.fps) == (1280, 1024, 8, 30)
    assert (memory.seconds, memory.pictures, memory.buffers, memory.saturated) == (20, 24, 8, 0)


def test_a_fault_without_an_amount_has_that_of_its_kind() -> None:
    assert CAMERA_FAULTS == {"drop": 3, "damage": 1, "stall": 1, "disconnect": 2, "gone": 0}
    seconds = ("silence", "late", "unplug", "reset", "overload", "unstable", "unit", "comma", "cr")
    lines = ("partial", "split", "duplicate")
    others = {"garbage": 40, "nul": 8, "backlog": 5, "jump": 3600, "rate": 0.5}
    assert dict.fromkeys((*seconds, *lines), 1.0) | others == SERIAL_FAULTS


def test_a_specimen_that_just_yields_does_so_at_the_end_of_the_ramp() -> None:
    assert specimen_from(parse_address("sim:?seconds=20&max_strain=0.002")).yield_s == pytest.approx(19)
    assert specimen_from(parse_address("sim:?seconds=20&max_strain=0.0019")).yield_s == math.inf
    with pytest.raises(ConfigError, match="hold and end leave no time to pull; give seconds above 2"):
        specimen_from(parse_address("sim:?seconds=2&hold=1.5&end=0.5"))
