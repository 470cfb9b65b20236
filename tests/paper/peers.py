"""Other programs on the same pairs: OpenCV's PyrLK and DIS always, pyvale and SUN-DIC where installed."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquire.cv2_loader import load_cv2
from analysis.field import Roi, ZoiGrid
from hw_mocks.deformation import Affine
from live.setup.pattern.outcome import ExperimentContext, ExperimentOutcome, ResultTable, figure, save_figure
from tests.paper.others import PROGRAMS, Program, installed
from tests.paper.others import STEP as OTHERS_STEP
from tests.paper.outcomes import Comparison, verdict
from tests.paper.truth import SensorModel, TrueScene, ours, papers

log = logging.getLogger(__name__)

Floats = NDArray[np.float64]
Flow = Callable[[Any, Any, Floats], Floats]
Engine = Callable[[Any, Any, float], tuple[Floats, Floats]]
SUBSET, ZOI, STRAIN_ZOI = 33, 56, 76
"""Side of the peers' subset; of our Gaussian ZOI with about the same l_10% (130 px); and of the one with that
of a plane fitted to 5x5 subsets 8 px apart, sqrt(9.5^2 + 20^2/5) px as a Gaussian weight."""
SHIFTS = np.linspace(-0.5, 0.5, 9)
STRAIN = 6.3e-4
GAUGE = 5  # points along each side of the plane fitted for strain, 8 px apart
RADIUS = 2.25  # px; 5.3 px full width at half maximum


def pyramid_flow(reference: Any, deformed: Any, points: Floats) -> Floats:
    """OpenCV's pyramidal Lucas-Kanade, 33 px, 3 levels; (N, 2) px at (N, 2) points x, y."""
    cv2 = load_cv2()

    start = points.astype(np.float32).reshape(-1, 1, 2)
    criteria = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 50, 1e-4)
    found, _, _ = cv2.calcOpticalFlowPyrLK(
        reference, deformed, start, None, winSize=(SUBSET, SUBSET), maxLevel=3, criteria=criteria
    )
    return np.asarray((found - start).reshape(-1, 2), float)


def dense_flow(reference: Any, deformed: Any, points: Floats) -> Floats:
    """OpenCV's DIS optical flow, medium preset, averaged over 33 px around the points."""
    cv2 = load_cv2()

    flow = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM).calc(reference, deformed, None)
    mean = cv2.blur(flow, (SUBSET, SUBSET))
    columns, rows = np.rint(points).astype(int).T
    return np.asarray(mean[rows, columns], float)


PEERS: dict[str, Flow] = {"OpenCV PyrLK, 33 px": pyramid_flow, "OpenCV DIS, mean of 33 px": dense_flow}


def plane_strain(u: Floats, step: int) -> Floats:
    """exx by a plane fitted to every GAUGE x GAUGE points of a map of u (px)."""
    from scipy.ndimage import correlate

    offsets = np.arange(GAUGE) - GAUGE // 2
    kernel = np.tile(offsets, (GAUGE, 1)) / (GAUGE * np.sum(offsets**2) * step)
    slope = correlate(u, kernel, mode="nearest")
    half = GAUGE // 2
    return np.asarray(slope[half:-half:GAUGE, half:-half:GAUGE])


def peers(context: ExperimentContext) -> ExperimentOutcome:
    """Bias and noise of rigid shifts, and strain on a 65 px gauge, of all engines on the same 8-bit pairs."""
    shape = (320, 400) if context.quick else (512, 640)
    scene = TrueScene(shape, RADIUS, seed=77)
    grid = ZoiGrid.cover(Roi(16, 16, shape[1] - 32, shape[0] - 32), ZOI, 8)
    engines = _engines(grid)
    columns = (
        "engine", "largest bias of u px", "std of u, no noise px", "std of u, 1 % noise px",
        "strain error: mean um/m", "strain error: std um/m", "u with gain 0.8, offset -10 GL: error px",
    )  # fmt: skip
    rows: list[tuple[Any, ...]] = []
    curves: dict[str, list[float]] = {}
    failed: list[str] = []
    for name, engine in context.steps(engines.items()):
        try:
            curve, row = _compared(name, engine, scene, shape)
        except Exception as error:
            if name not in PROGRAMS:
                raise
            # An optional program that fails does not end the run; the page names it.
            log.warning("%s failed: %s", name, error)
            failed.append(f"{name.split(',')[0]} is installed but failed ({type(error).__name__}: {error}).")
            continue
        curves[name] = curve
        rows.append(row)
    table = ResultTable("peers", columns, tuple(rows))
    name = _draw(context, curves)
    return ExperimentOutcome(
        "peers", "Peers on the same pairs", _text(table, name, failed), (table,), (name,), _verdicts(table)
    )


def _compared(
    name: str, engine: Engine, scene: TrueScene, shape: tuple[int, int]
) -> tuple[list[float], tuple[Any, ...]]:
    """Bias at each shift, px, and the row of the table."""
    shifts = [_shift_error(scene, engine, float(s), 0.0) for s in SHIFTS]
    curve = [bias for bias, _ in shifts]
    noisy = _shift_error(scene, engine, 0.25, 2.55)
    strain = _strain_error(scene, engine, shape)
    figures = (float(np.max(np.abs(curve))), float(np.mean([std for _, std in shifts])), noisy[1])
    light = _illumination_error(scene, engine)
    return curve, (name, *figures, 1e6 * float(np.mean(strain)), 1e6 * float(np.std(strain)), light)


def _engines(grid: ZoiGrid) -> dict[str, Engine]:
    """Name -> (reference, deformed, noise GL) -> (u px on the grid, exx for the gauge)."""

    more, roi = (STRAIN_ZOI - ZOI) // 2, grid.roi
    around = Roi(roi.x - more, roi.y - more, roi.width + 2 * more, roi.height + 2 * more)
    wide = ZoiGrid.cover(around, STRAIN_ZOI, 8)

    def mine(reference: Any, deformed: Any, noise: float) -> tuple[Floats, Floats]:
        field = ours((reference, deformed), grid, noise)
        return field.u, ours((reference, deformed), wide, noise).exx[2:-2:GAUGE, 2:-2:GAUGE]

    def as_printed(reference: Any, deformed: Any, noise: float) -> tuple[Floats, Floats]:
        size = (ZOI - 32) // 2
        roi = Roi(16 + size, 16 + size, grid.roi.width - 2 * size, grid.roi.height - 2 * size)
        field = papers((reference, deformed), ZoiGrid.cover(roi, 32, 16))
        return field.u, plane_strain(field.u, 16)

    def of(flow: Flow) -> Engine:
        def measure(reference: Any, deformed: Any, noise: float) -> tuple[Floats, Floats]:
            x, y = np.meshgrid(grid.x, grid.y)
            points = np.column_stack([x.ravel(), y.ravel()])
            u = flow(reference, deformed, points)[:, 0].reshape(grid.shape)
            return u, plane_strain(u, 8)

        return measure

    known: dict[str, Engine] = {f"ours, {ZOI} px Gaussian": mine, "the paper's estimator, 32 px": as_printed}
    return (
        known
        | {name: of(flow) for name, flow in PEERS.items()}
        | {n: _program(p) for n, p in installed().items()}
    )


def _program(program: Program) -> Engine:
    def measure(reference: Any, deformed: Any, noise: float) -> tuple[Floats, Floats]:
        u = program(reference, deformed)
        return u, plane_strain(u, OTHERS_STEP)

    return measure


def _shift_error(scene: TrueScene, engine: Any, shift: float, noise: float) -> tuple[float, float]:
    camera = SensorModel(8, noise)
    u, _ = engine(*scene.pair(Affine(shift), camera), camera.sigma)
    return float(np.nanmean(u)) - shift, float(np.nanstd(u))


def _strain_error(scene: TrueScene, engine: Any, shape: tuple[int, int]) -> Floats:
    camera = SensorModel(8)
    deformation = Affine(du_dx=STRAIN, x0=shape[1] / 2, y0=shape[0] / 2)
    _, exx = engine(*scene.pair(deformation, camera), camera.sigma)
    return np.asarray(exx[np.isfinite(exx)] - STRAIN)


def _illumination_error(scene: TrueScene, engine: Any) -> float:
    camera = SensorModel(8)
    reference, deformed = scene.pair(Affine(0.25), camera)
    darker = np.clip(np.rint(deformed * 0.8 - 10), 0, 255).astype(np.uint8)
    u, _ = engine(reference, darker, camera.sigma)
    return float(np.sqrt(np.nanmean((u - 0.25) ** 2)))


def _draw(context: ExperimentContext, curves: dict[str, list[float]]) -> str:
    drawn = figure(9, 4)
    axes = drawn.subplots()
    for name, values in curves.items():
        axes.semilogy(SHIFTS, np.maximum(np.abs(values), 1e-6), "o-", label=name)
    axes.set(xlabel="true shift, px", ylabel="|mean error of u|, px", title="8 bit, no noise")
    axes.grid(alpha=0.3, which="both")
    axes.legend(fontsize=8)
    return save_figure(context, "peers.png", drawn)


def _verdicts(table: ResultTable) -> tuple[Comparison, ...]:
    mine, *others = table.rows
    found = []
    for other in others:
        found.append(verdict("largest bias of u, 8 bit", "px", mine[1], other[1], other[0]))
        found.append(verdict("std of u, 1 % noise", "px", mine[3], other[3], other[0]))
        found.append(verdict("std of strain, 65 px gauge", "um/m", mine[5], other[5], other[0]))
    return tuple(found)


def _text(table: ResultTable, name: str, failed: list[str]) -> str:
    return f"""The same 8-bit pairs for all: shifts from -0.5 to 0.5 px without noise, 1 % noise (2.55 GL) at 0.25 px, a
strain of {STRAIN:g}, and a change of light (gain 0.8, offset -10 GL) at 0.25 px. Ours is a {ZOI} px Gaussian ZOI, with
about the l_10% of the others' 33 px subset (130 px). Strain: ours is that of a {STRAIN_ZOI} px ZOI itself, the others'
a plane fitted to 5x5 points 8 px apart (a gauge of 65 px, of about the same l_10%; 16 px apart for the paper's, which
is coarser). DIS smooths its flow beyond the 33 px averaged here, which flatters its noise.
{" ".join([present(), *failed])}

{table.markdown()}

![Bias of rigid shifts]({name})"""


def present() -> str:
    """A sentence on which of the optional programs took part."""
    missing = [name.split(",")[0] for name in PROGRAMS if name not in installed()]
    if not missing:
        return "pyvale and SUN-DIC run with their own defaults (SUN-DIC with splines of order 5)."
    return f"Not installed and therefore left out: {' and '.join(missing)} (`pip install pyvale sun-dic`)."
