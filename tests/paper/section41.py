"""Section 4.1 of the paper, Figs. 4 and 5: a sine of displacement, direct strain beside classical derivation."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.field import Roi, ZoiGrid
from hw_mocks.deformation import Wave
from live.setup.pattern.outcome import ExperimentContext, ExperimentOutcome, ResultTable, figure, save_figure
from tests.paper.estimator import PaperSettings
from tests.paper.outcomes import Comparison, colour_map, verdict
from tests.paper.truth import Limit, SensorModel, TrueScene, limit, ours, papers

Floats = NDArray[np.float64]
AMPLITUDE, PERIOD, BITS, RADIUS = 0.02, 128.0, 8, 2.0
SMALL, LARGE, SAME_LENGTH = 32, 64, 46
"""ZOIs of the paper for displacement and strain, and ours with the l_10% of its strain (104 px)."""
NOISES = {"no noise": 0.0, "1 % noise": 2.55}
PAPER_U, PAPER_DIRECT, PAPER_CLASSICAL = 0.003, 1.7e-4, 2.6e-4
PAPER_S = {SMALL: 65.5 / 13.69, LARGE: 104 / 13.69}
"""Gaussian weight with the l_10% of the paper's estimator (section on spatial resolution), px."""


@dataclass(frozen=True, slots=True, eq=False)
class SineMaps:
    """Maps at the same places, (R, C): u (px) of the small ZOI, exx direct and classical."""

    u: Floats
    direct: Floats
    classical: Floats


def derived(u: Floats, step: int, low_pass: float) -> Floats:
    """exx by a Gaussian low-pass (px) of a map of u and a least-squares plane over 3x3 of its points."""
    from scipy.ndimage import correlate1d, gaussian_filter, uniform_filter1d

    smooth = gaussian_filter(u, low_pass / step, mode="nearest") if low_pass > 0 else u
    slope = correlate1d(smooth, np.array([-0.5, 0.0, 0.5]) / step, axis=1, mode="nearest")
    return np.asarray(uniform_filter1d(slope, 3, axis=0, mode="nearest"))


def low_pass_for(direct: float, displacement: float, step: int) -> float:
    """sigma of the low-pass, px, that brings a derived map to the spatial resolution of the direct one.

    All as Gaussian weights: that of the direct strain, that of the displacement, and the three-point
    derivative, which is worth step^2/3.
    """
    return math.sqrt(max(direct**2 - displacement**2 - step**2 / 3, 0.0))


class SineField:
    """The picture, its grids and its truth."""

    def __init__(self, quick: bool) -> None:
        self.step = 8
        self.shape = (160, 320) if quick else (320, 512)
        self.scene = TrueScene(self.shape, RADIUS, seed=21)
        self.wave = Wave(AMPLITUDE, PERIOD)
        centres = self.grid(LARGE).x
        rows = len(self.grid(LARGE).y)
        self.u = np.tile(self.wave.displacement(centres, 0)[0], (rows, 1))
        self.exx = np.tile(self.wave.gradient(centres, np.zeros_like(centres))[0], (rows, 1))

    def grid(self, size: int) -> ZoiGrid:
        """ZOIs of any even size at the same centres."""
        edge, (height, width) = (LARGE - size) // 2, self.shape
        return ZoiGrid.cover(Roi(edge, edge, width - 2 * edge, height - 2 * edge), size, self.step)

    def limit(self, size: int) -> Limit:
        """Noise limit and attenuation for the pattern used."""
        y, x = np.mgrid[: self.shape[0], : self.shape[1]]
        return limit(self.scene.slopes, self.grid(size), size / 6, self.wave.displacement(x, y))

    def inner(self, values: Floats) -> Floats:
        """Without the outermost points, where filters reach the edge."""
        return values[2:-2, 2:-2]

    def rms(self, values: Floats, truth: Floats) -> float:
        """Root mean square of the error."""
        return float(np.sqrt(np.nanmean(self.inner(values - truth) ** 2)))


def measured(field: SineField, noise: float, context: ExperimentContext, done: float) -> dict[str, SineMaps]:
    """The paper's estimator, ours at the paper's sizes, and ours at its spatial resolution."""
    camera = SensorModel(BITS, noise)
    pair = field.scene.pair(field.wave, camera)
    small, large, same = (field.grid(size) for size in (SMALL, LARGE, SAME_LENGTH))
    paper_u, paper_direct = papers(pair, small).u, papers(pair, large).exx
    context.tick(done + 0.3)
    mine_u = ours(pair, small, camera.sigma).u
    mine, mine_same = (ours(pair, grid, camera.sigma) for grid in (large, same))
    context.tick(done + 0.4)
    smooth = low_pass_for(PAPER_S[LARGE], PAPER_S[SMALL], field.step)
    smooth_ours = low_pass_for(LARGE / 6, SMALL / 6, field.step)
    smooth_same = low_pass_for(SAME_LENGTH / 6, SMALL / 6, field.step)
    return {
        "paper": SineMaps(paper_u, paper_direct, derived(paper_u, field.step, smooth)),
        "ours": SineMaps(mine_u, mine.exx, derived(mine_u, field.step, smooth_ours)),
        "same": SineMaps(mine_u, mine_same.exx, derived(mine_u, field.step, smooth_same)),
    }


def bounds(field: SineField, limits: dict[int, Limit], noise: float) -> dict[str, float]:
    """Predicted rms: noise of both pictures (rounding included) and window attenuation, in squares."""
    camera, found = SensorModel(BITS, noise), {}
    for name, size, index, truth in (
        ("u", SMALL, 0, field.u), ("ours", LARGE, 1, field.exx), ("same", SAME_LENGTH, 1, field.exx),
    ):  # fmt: skip
        response = limits[size].response
        assert response is not None
        noise_part = limits[size].sigma[index] * camera.sigma / camera.top
        total = noise_part**2 + (response[index] - truth) ** 2
        found[name] = float(np.sqrt(np.mean(field.inner(total))))
    return found


def section41(context: ExperimentContext) -> ExperimentOutcome:
    """0.02 sin(2 pi x/128) px, 8 bit, without noise and with 1 %."""
    field = SineField(context.quick)
    limits = {size: field.limit(size) for size in (SMALL, LARGE, SAME_LENGTH)}
    rows: list[tuple[Any, ...]] = []
    verdicts: list[Comparison] = []
    kept: dict[str, SineMaps] = {}
    for number, (label, noise) in enumerate(NOISES.items()):
        maps = measured(field, noise, context, 0.5 * number)
        bound = bounds(field, limits, noise)
        found = _rows(field, label, maps, bound)
        rows += found
        if not noise:
            kept = maps
            verdicts = _verdicts(found)
    columns = (
        "noise", "quantity", "the paper", "its estimator", "ours, ZOI 32 / 64", "predicted limit", "ours / limit",
        f"ours, ZOI {SAME_LENGTH}, the paper's l_10%", "its limit",
    )  # fmt: skip
    table = ResultTable("section41", columns, tuple(rows))
    name = _draw(context, field, kept)
    whole = papers(
        field.scene.pair(field.wave, SensorModel(BITS)),
        field.grid(LARGE),
        PaperSettings(overlay="whole-pixel"),
    )
    return ExperimentOutcome(
        "section41",
        "Section 4.1, Figs. 4 and 5: the sine field",
        _text(table, name, field.rms(whole.exx, field.exx)),
        (table,),
        (name,),
        tuple(verdicts),
    )


def _rows(
    field: SineField, label: str, maps: dict[str, SineMaps], bound: dict[str, float]
) -> list[tuple[Any, ...]]:
    nothing = float("nan")
    clean = label == "no noise"
    u = [field.rms(maps[name].u, field.u) for name in ("paper", "ours")]
    direct = {name: field.rms(each.direct, field.exx) for name, each in maps.items()}
    classical = {name: field.rms(each.classical, field.exx) for name, each in maps.items()}
    paper = (PAPER_U, PAPER_DIRECT, PAPER_CLASSICAL) if clean else (nothing,) * 3
    return [
        (label, "rms of u, px", paper[0], u[0], u[1], bound["u"], u[1] / bound["u"], nothing, nothing),
        (label, "rms of exx, direct", paper[1], direct["paper"], direct["ours"], bound["ours"],
         direct["ours"] / bound["ours"], direct["same"], bound["same"]),
        (label, "rms of exx, classical", paper[2], classical["paper"], classical["ours"], nothing, nothing,
         classical["same"], nothing),
    ]  # fmt: skip


def _verdicts(rows: list[tuple[Any, ...]]) -> list[Comparison]:
    u, direct, classical = rows
    return [
        verdict("rms of u, sine field", "px", u[4], u[2], "the paper"),
        verdict("rms of u, sine field", "px", u[4], u[5], "the predicted limit"),
        verdict("rms of strain, sine field, direct, ZOI 64", "", direct[4], direct[2], "the paper"),
        verdict("rms of strain, sine field, direct, ZOI 64", "", direct[4], direct[5], "the predicted limit"),
        verdict(f"rms of strain, direct, ZOI {SAME_LENGTH}", "", direct[7], classical[7], "our classical derivation"),
    ]  # fmt: skip


def _draw(context: ExperimentContext, field: SineField, maps: dict[str, SineMaps]) -> str:
    drawn = figure(14, 5.2)
    axes = drawn.subplots(2, 4)
    span, strain = (-0.03, 0.03), (-1500.0, 1500.0)
    shown = [
        (field.u, "u, truth", span), (maps["paper"].u, "u, the paper's estimator, 32 px", span),
        (maps["ours"].u, "u, ours, 32 px", span),
    ]  # fmt: skip
    for place, (values, title, limits) in zip(axes[0], shown, strict=False):
        colour_map(place, values, title, "px", limits)
    strains = [
        (maps["paper"].direct, "exx, the paper's, direct, 64 px"), (maps["ours"].direct, "exx, ours, direct, 64 px"),
        (maps["same"].direct, f"exx, ours, direct, {SAME_LENGTH} px"),
        (maps["same"].classical, f"exx, ours, classical, as {SAME_LENGTH} px"),
    ]  # fmt: skip
    for place, (values, title) in zip(axes[1], strains, strict=True):
        colour_map(place, 1e6 * values, title, "um/m", strain)
    _draw_row(axes[0, 3], field, maps)
    return save_figure(context, "fig4_5_sine.png", drawn)


def _draw_row(axes: Any, field: SineField, maps: dict[str, SineMaps]) -> None:
    x, row = field.grid(LARGE).x, len(field.exx) // 2
    axes.plot(x, 1e6 * field.exx[row], "k", label="truth")
    axes.plot(x, 1e6 * maps["paper"].direct[row], label="the paper's")
    axes.plot(x, 1e6 * maps["ours"].direct[row], label="ours")
    axes.set(xlabel="x, px", title="exx on the middle row")
    axes.set_ylabel("exx, um/m")
    axes.title.set_fontsize(9)
    axes.legend(fontsize=7)


def _text(table: ResultTable, name: str, whole: float) -> str:
    u, direct, classical = table.rows[:3]
    noisy = table.rows[4:6]
    return f"""u = {AMPLITUDE} sin(2 pi x/{PERIOD:g}) px, 8 bit, speckle radius {RADIUS:g} px, ZOI 32 for the
displacement and 64 for the strain, at every 8 px. The limit is computed for the pattern used: the noise that
rounding (and the noise added) makes in a weighted least-squares fit with our window, and what that window takes
from this very field.

{table.markdown()}

Ours is at {u[6]:.2f} (u) and {direct[6]:.2f} (strain) times its limit. Classical: the map of u of 32 px ZOIs, Gaussian
low-pass and a plane fitted over 3x3 points, at the spatial resolution of the direct strain beside it. For ours, on
the same pictures: direct {direct[7]:.2e}, classical {classical[7]:.2e} without noise; {noisy[0][7]:.2e} and
{noisy[1][7]:.2e} with 1 %. A weighted least-squares ZOI and a low-passed map of smaller ZOIs use the same
information; where they differ it is by the shape of the weight, not by the phase. In the paper's estimator part of
the error is the overlay by linear interpolation, which shows a strain of about -|u|/sigma_w^2, up to
{1e6 * AMPLITUDE / (LARGE / 6) ** 2:.0f} um/m here; overlaid by whole pixels
instead (it may be read so) its rms is {whole:.2e}.

![Displacement and strain of the sine field]({name})"""
