"""The measuring path by itself: noise handed on, the reference renewed, by itself and on demand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from acquire.events import Event, EventKind
from acquire.frame import Burst
from acquire.load_cell.load_log import LoadLog
from acquire.load_sample import LoadSample
from analysis import KernelSettings, Roi, ZoiGrid
from hw_mocks.deformation import Affine
from hw_mocks.speckle import Speckle
from live.measure.pipeline import NewReference, measure
from live.measure.preparation import averaged, frame_noise, motion_between, prepare

SHAPE = (160, 192)
GRID = ZoiGrid.cover(Roi(24, 24, 144, 112), size=32, step=16)


def burst(image: np.ndarray, number: int, n: int = 1, noise: float = math.nan) -> Burst:
    nothing = np.zeros(image.shape, bool)
    return Burst(
        image.astype(np.float32), n, noise, nothing, 8, float(number), 0.0, number, number, 0, "nominal"
    )


def picture(speckle: Speckle, **gradient: float) -> np.ndarray:
    return np.asarray(255 * speckle.render(Affine(x0=96, y0=80, **gradient), SHAPE))


@pytest.fixture(scope="module")
def speckle() -> Speckle:
    return Speckle(SHAPE, radius=2.0, seed=5)


def test_noise_is_that_of_the_average() -> None:
    image = np.zeros((4, 4))
    assert frame_noise(burst(image, 0), None) is None
    assert frame_noise(burst(image, 0, 8, 1.5), None) == 1.5
    assert frame_noise(burst(image, 0, 8, 1.5), 3.0) == 3.0
    assert frame_noise(burst(image, 0, 8, 0.0), None) is None  # no scatter at all tells nothing
    assert averaged(2.0, 16) == 0.5
    assert averaged(0.0, 1) == pytest.approx(12**-0.5)
    assert averaged(None, 4) is None


def test_each_burst_with_its_force(speckle: Speckle) -> None:
    loads = LoadLog(10.0)
    for t in range(4):
        loads.append(LoadSample(t=float(t), force=100.0 * t))
    kernel, noise = prepare(burst(picture(speckle), 0, 8, 1.0), GRID, KernelSettings(), None)
    assert noise == 1.0
    bursts = [burst(picture(speckle, v=0.3 * i, dv_dy=1e-3 * i), i) for i in (1, 2, 3)]
    found = list(measure(bursts, kernel, loads, noise_GL=noise))
    assert [m.number for m in found] == [0, 1, 2]
    assert [m.force for m in found] == [100.0, 200.0, 300.0]
    assert [m.field.mean("eyy")[0] for m in found] == pytest.approx([1e-3, 2e-3, 3e-3], abs=5e-6)


def test_motion_between_halves(speckle: Speckle) -> None:
    kernel, _ = prepare(burst(picture(speckle, u=0.05), 0), GRID, KernelSettings(), 1.0)
    moved = motion_between(kernel, burst(picture(speckle), 1), burst(picture(speckle, u=0.1), 2))
    assert moved == pytest.approx(0.1, abs=0.002)


@pytest.mark.parametrize("on_demand", [True, False])
def test_a_renewed_reference_stays_composed(speckle: Speckle, on_demand: bool) -> None:
    told: list[Event] = []
    images = [picture(speckle, u=2.0, du_dx=0.02), picture(speckle, u=3.0, du_dx=0.03)]
    kernel, noise = prepare(burst(picture(speckle), 0), GRID, KernelSettings(), 1.0)
    if on_demand:
        steps = [burst(images[0], 1), NewReference(burst(images[0], 2)), burst(images[1], 3)]
    else:
        # Another pattern fades in: the first reference no longer fits the last picture.
        other = Speckle(SHAPE, radius=2.0, seed=6)
        fading = zip((0.96, 0.92), ({"u": 2.0, "du_dx": 0.02}, {"u": 3.0, "du_dx": 0.03}), strict=True)
        mixed = [w * picture(speckle, **g) + (1 - w) * picture(other, **g) for w, g in fading]
        steps = [burst(image, i) for i, image in enumerate(mixed, 1)]
    found = list(measure(steps, kernel, LoadLog(), noise_GL=noise, renew_at=0.2, on_event=told.append))
    renewals = [event for event in told if event.kind is EventKind.REFERENCE]
    assert len(renewals) == 1
    assert renewals[0].data["automatic"] is not on_demand
    last = found[-1].field
    assert np.isfinite(last.exx).mean() > (0.99 if on_demand else 0.7)
    assert last.mean("exx")[0] == pytest.approx(0.03, abs=2e-5 if on_demand else 2e-3)


def test_a_blank_picture_does_not_end_the_measurement(speckle: Speckle) -> None:
    kernel, noise = prepare(burst(picture(speckle), 0), GRID, KernelSettings(), 1.0)
    told: list[Event] = []
    blank = np.full(SHAPE, 128.0)
    steps = [burst(blank, 1), NewReference(burst(blank, 2)), burst(picture(speckle, u=0.4), 3)]
    found = list(measure(steps, kernel, LoadLog(), noise_GL=noise, renew_at=0.2, on_event=told.append))
    assert np.isnan(found[0].field.u).all()
    assert np.isfinite(found[1].field.u).all()
    assert found[1].field.mean("u")[0] == pytest.approx(0.4, abs=1e-3)
    assert "was not renewed" in told[0].text
