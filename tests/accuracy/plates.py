"""Plates on simulated truth: strain, E and coverage at 500 mm, with motion off the plane that grows with the load."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis import PhaseKernel, Roi, StrainField, ZoiGrid
from analysis.evaluate import AreaStrain, Curve, Interval, TensileOptions, evaluate_test, free
from analysis.field import part_of
from analysis.optics import Box, Model, PlateFit, PlateLayout, choose_model
from hw_mocks.machine import FlowCurve, Programme
from hw_mocks.optics import Optics, PlaneMotion
from hw_mocks.scene import Exposer, Scene, Sensor
from hw_mocks.specimen import VirtualSpecimen

STAND_OFF_MM, TOWARDS_MM, TILT = 500.0, 0.1, math.radians(0.1)
NOISE, BURST, REFERENCE = 0.01, 4, 32
STRAIN, SECONDS = 2.5e-3, 10.0
CASES: Mapping[str, tuple[int, Roi, dict[str, Box]]] = {
    "two of 100 x 400 px": (640, Roi(170, 40, 300, 800), {"left": (30, 240, 100, 400), "right": (510, 240, 100, 400)}),
    "one of 300 x 800 px": (720, Roi(380, 40, 300, 800), {"left": (40, 40, 300, 800)}),
}  # fmt: skip
"""Width of the picture, region of the specimen, and plates."""
LIMITS = {"two of 100 x 400 px": 10e-6, "one of 300 x 800 px": 15e-6}
"""Of the error of the mean strain, root mean square over the bursts of a test."""
MAX_E_ERROR, COVERAGE = 0.003, (0.93, 0.97)


@dataclass(frozen=True, slots=True, eq=False)
class PlateTest:
    """One simulated test: exx and eyy of the specimen, as measured, corrected, and the sigma of these, (N, 2) each."""

    model: Model
    true: NDArray[np.float64]
    raw: NDArray[np.float64]
    found: NDArray[np.float64]
    sigma: NDArray[np.float64]
    stress: NDArray[np.float64]  # (N,) Pa
    E: float  # of the specimen, Pa

    def modulus_error(self, strain: NDArray[np.float64]) -> float:
        """Of E from the strain along the load (N,), over E."""
        curve = Curve(np.arange(len(strain), dtype=float), strain, self.stress)
        options = TensileOptions(free(Interval("strain", 0.0002, 0.0024)))
        return evaluate_test(curve, options).E.value / self.E - 1

    @property
    def deviation(self) -> NDArray[np.float64]:
        """Error over its standard uncertainty, (N, 2)."""
        return np.asarray((self.found - self.true) / self.sigma)


def simulated(case: str, bursts: int, seed: int) -> PlateTest:
    """A test with so many bursts at rest and in the ramp, on a pattern and noise of its own."""
    width, roi, boxes = CASES[case]
    programme = Programme(1.0, SECONDS, 1.0, STRAIN / 2, STRAIN, 0.5)
    specimen = VirtualSpecimen(
        width=width, height=880, material=FlowCurve(yield_stress=400e6), programme=programme
    )
    settling = PlaneMotion(TOWARDS_MM, TILT, TILT)
    optics = Optics(STAND_OFF_MM, settling=settling, plates=tuple(boxes.values()))
    scene, exposer = (
        Scene(specimen, seed=seed, optics=optics),
        Exposer(Sensor.with_noise(12, NOISE), (880, width), seed),
    )
    fit = PlateFit(PlateLayout.of(ZoiGrid.cover(roi, 64, 16), boxes), ((width - 1) / 2, 439.5))
    noise = NOISE * 4095

    def picture(t: float, n: int) -> NDArray[np.float32]:
        light = scene.render(t)
        return np.mean([exposer.expose(light) for _ in range(n)], axis=0, dtype=np.float64).astype(np.float32)

    kernel = PhaseKernel(picture(0.0, REFERENCE), fit.layout.whole, noise=noise / math.sqrt(REFERENCE))
    times = 1.0 + SECONDS * np.arange(bursts) / (bursts - 1)
    chosen, start, rows = None, None, []
    for t in times.tolist():
        whole = start = kernel.measure(picture(t, BURST), start=start, noise=noise / math.sqrt(BURST))
        chosen = chosen or choose_model(fit, whole, STAND_OFF_MM * specimen.px_per_m * 1e-3)
        rows.append(_read(fit, whole, chosen.model))
    raw, found, sigma = np.moveaxis(np.array(rows), 1, 0)
    true = np.stack([specimen.transverse_strain(times), specimen.axial_strain(times)], axis=1)
    assert chosen is not None
    return PlateTest(chosen.model, true, raw, found, sigma, specimen.stress(times), specimen.E)


def _read(fit: PlateFit, whole: StrainField, model: Model) -> list[list[float]]:
    """exx and eyy as measured, corrected, and their standard uncertainties."""
    raw = part_of(whole, fit.layout.here, fit.layout.specimen)
    motion, covariance = fit.motion(whole, model)
    field = replace(motion.removed_from(raw), common=fit.error(raw, covariance))
    before, after = AreaStrain.of(raw), AreaStrain.of(field)
    assert before is not None
    assert after is not None
    names = ("exx", "eyy")
    return [
        [before.value(n) for n in names],
        [after.value(n) for n in names],
        [after.sigma(n) for n in names],
    ]


class PlateFigures(NamedTuple):
    """Of the tests of one case: rms errors of the mean strain and of E, raw and corrected, and coverage.

    The strain is that of the last quarter of the load.
    """

    case: str
    model: Model
    raw: float
    found: float
    e_raw: float
    e_found: float
    inside: float
    good: bool


def table(quick: bool) -> Iterator[PlateFigures]:
    """The figures of each case, and whether they are within their limits; E and coverage take more than ``quick``."""
    tests, bursts = (1, 12) if quick else (8, 40)
    for case in CASES:
        made = [simulated(case, bursts, seed) for seed in range(tests)]
        raw, found = (
            _rms([(getattr(m, name) - m.true)[-bursts // 4 :] for m in made]) for name in ("raw", "found")
        )
        e_raw, e_found = (
            _rms([m.modulus_error(getattr(m, name)[:, 1]) for m in made]) for name in ("raw", "found")
        )
        inside = float(np.mean(np.abs(np.concatenate([m.deviation for m in made])) < 1.96))
        exact = e_found <= MAX_E_ERROR and COVERAGE[0] <= inside <= COVERAGE[1]
        good = found <= LIMITS[case] and (quick or exact)
        yield PlateFigures(case, made[0].model, raw, found, e_raw, e_found, inside, good)


def _rms(errors: list[Any]) -> float:
    return float(np.sqrt(np.mean(np.square(errors))))
