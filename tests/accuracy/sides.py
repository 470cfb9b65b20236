"""Two cameras on simulated truth: strain, E and coverage of the mean of front and back, through the program itself."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from acquire.addresses import parse_address
from hw_mocks.specimen import VirtualSpecimen, specimen_from
from live.config.cameras import camera_configs
from live.config.loading import load_config
from live.pipeline.consumer import Screen
from live.results.run_folder import open_run
from live.results.sides import SidesOfTest
from live.results.writer import write_results
from live.run.live_run import CameraOfTest, run_cameras

FPS, BURST = 16, 4
VIEW = (
    f"width=640&height=880&seconds=12&hold=2.2&end=0.3&fps={FPS}&max_strain=0.0025&yield_MPa=400&noise=1&lockstep=yes"
    "&stand_off_mm=500&settle_mm=0.1&settle_x_deg=0.1&settle_y_deg=0.1&bending=3"
)
SETTINGS = {
    "measure.roi": [168, 40, 304, 800], "measure.burst": BURST, "measure.reference_burst": 32, "specimen.axis": "y",
    "specimen.area_mm2": 40.0, "specimen.standard": "free", "specimen.modulus_between": [0.0005, 0.002],
    "record.enabled": False,
}  # fmt: skip
MAX_ERROR, MAX_E_ERROR, COVERAGE = 5e-6, 0.003, (0.93, 0.97)


class SidesError(NamedTuple):
    """Of one test: errors along and across the load (2, N) and over sigma, of the front alone, and of E over E."""

    found: NDArray[np.float64]
    over_sigma: NDArray[np.float64]
    front: NDArray[np.float64]
    e_found: float
    e_front: float


def simulated(seed: int) -> SidesError:
    """A test with patterns and noise of its own."""
    specimen = specimen_from(parse_address(f"sim:?{VIEW}"))
    with TemporaryDirectory() as name:
        cameras = {
            "camera.address": f"sim:?{VIEW}&seed={2 * seed}",
            "camera.back": f"sim:?{VIEW}&side=back&seed={2 * seed + 1}",
            "load.address": f"sim:?seed={seed}",
            "output.dir": name,
        }
        configs = camera_configs(load_config(None, {**SETTINGS, **cameras}), {})
        run_cameras({side: CameraOfTest(config, Screen(), write_results) for side, config in configs.items()})
        with open_run(Path(name) / "front") as front, open_run(Path(name) / "back") as back:
            sides = SidesOfTest.of_folders(front, back)
    return _errors(sides, specimen)


def _errors(sides: SidesOfTest, specimen: VirtualSpecimen) -> SidesError:
    along, across = sides.courses["axial"], sides.courses["transverse"]
    t = (
        along.t[:, None] + (np.arange(BURST) - (BURST - 1) / 2) / FPS
    )  # of each frame: a burst may end beyond the ramp
    true = [of(t).mean(axis=1) for of in (specimen.axial_strain, specimen.transverse_strain)]
    found = np.array([along.mean, across.mean]) - true
    front = np.array([along.mean + along.bending, across.mean + across.bending]) - true
    over = found / np.array([along.sigma, across.sigma])
    return SidesError(
        found,
        over,
        front,
        sides.figures["both"].E.value / specimen.E - 1,
        sides.figures["front"].E.value / specimen.E - 1,
    )


class SidesFigures(NamedTuple):
    """Of all tests: rms errors of the last quarter, of E, and the share within the 95 % interval."""

    front: float
    found: float
    e_front: float
    e_found: float
    inside: float
    good: bool


def figures(quick: bool) -> SidesFigures:
    """The figures, and whether they are within their limits; coverage takes more than ``quick``."""
    made = [simulated(seed) for seed in range(1 if quick else 16)]
    last = len(made[0].found[0]) // 4
    front, found = (_rms(np.array([getattr(one, n)[:, -last:] for one in made])) for n in ("front", "found"))
    e_front, e_found = (_rms(np.array([getattr(one, n) for one in made])) for n in ("e_front", "e_found"))
    inside = float(np.mean(np.abs(np.array([one.over_sigma for one in made])) < 1.96))
    exact = quick or COVERAGE[0] <= inside <= COVERAGE[1]
    return SidesFigures(
        front, found, e_front, e_found, inside, found <= MAX_ERROR and e_found <= MAX_E_ERROR and exact
    )


def _rms(errors: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean(errors**2)))
