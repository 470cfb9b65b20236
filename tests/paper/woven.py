"""Section 4.2 of the paper, Figs. 6 and 7: maps on a woven composite, simulated with known truth, and on a real one.

The paper filters its strain maps "for cosmetic reasons". ``for_display`` does the same for pictures;
measured values stay as they are.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquire.opencv.images import read_image
from analysis.field import Roi, StrainField, ZoiGrid
from hw_mocks.deformation import SpecimenDeformation, StrainModes
from live.commands.map import PAPER_LOW_PASS, for_display
from live.setup.pattern.outcome import (
    ExperimentContext,
    ExperimentOutcome,
    ResultTable,
    figure,
    save_figure,
    shown,
)
from tests.paper.estimator import PaperSettings
from tests.paper.outcomes import Comparison, colour_map, verdict
from tests.paper.truth import SensorModel, TrueScene, ours, papers

Floats = NDArray[np.float64]
CELL, OVER, MEAN_STRAIN, NU = 160.0, 0.6, 1e-3, 0.3
SIZE, BITS, NOISE = 64, 12, 5.0
SMALLER = 44
WHOLE = PaperSettings(overlay="whole-pixel", search_px=12)
HOLE = "dic_challenge_1_sample12_ohtcfrp"
HOLE_FRAMES = ("oht_cfrp_00.tiff", "oht_cfrp_04.tiff", "oht_cfrp_11.tiff")
HOLE_ROI = Roi(20, 30, 360, 980)
BACKGROUND = 30  # grey levels, smoothed: below is hole or background


def woven(context: ExperimentContext) -> ExperimentOutcome:
    """A plain weave in tension along x with over-strain where the yarns cross; truth known."""
    step = 16 if context.quick else 8
    shape = (256, 384) if context.quick else (384, 544)
    modes = StrainModes("woven", "x", (shape[1] - 1) / 2, (shape[0] - 1) / 2, cell=CELL, overstrain=OVER)
    motion = SpecimenDeformation(modes, MEAN_STRAIN, -NU * MEAN_STRAIN)
    scene, camera = TrueScene(shape, 2.0, seed=31), SensorModel(BITS, NOISE)
    pair = scene.pair(motion, camera)
    edge = SIZE // 2
    roi = Roi(edge, edge, shape[1] - SIZE, shape[0] - SIZE)
    grid = ZoiGrid.cover(roi, SIZE, step)
    inset = (SIZE - SMALLER) // 2
    fine = ZoiGrid.cover(
        Roi(edge + inset, edge + inset, roi.width - 2 * inset, roi.height - 2 * inset), SMALLER, step
    )
    context.tick(0.1)
    fields: dict[str, Any] = {"ours": ours(pair, grid, camera.sigma), "fine": ours(pair, fine, camera.sigma)}
    fields["paper"] = papers(pair, grid)
    context.tick(0.5)
    fields["whole"] = papers(pair, grid, WHOLE)
    context.tick(0.9)
    y, x = np.meshgrid(grid.y, grid.x, indexing="ij")
    truth = dict(zip(("du_dx", "du_dy", "dv_dx", "dv_dy"), motion.gradient(x, y), strict=True))
    truth |= dict(zip(("u", "v"), motion.displacement(x, y), strict=True))
    truth["exx"], truth["exy"] = truth["du_dx"], 0.5 * (truth["du_dy"] + truth["dv_dx"])
    table = _errors(fields, truth, step)
    name = _draw_woven(context, fields, truth, step)
    return ExperimentOutcome(
        "woven",
        "Section 4.2: a simulated woven composite",
        _woven_text(table, name),
        (table,),
        (name,),
        _verdicts(table),
    )


def _errors(fields: dict[str, Any], truth: dict[str, Floats], step: int) -> ResultTable:
    columns = (
        "quantity", "its estimator", "its estimator, overlaid by whole pixels", "the latter, filtered as in the paper",
        f"ours, {SIZE} px", f"ours, {SMALLER} px",
        "largest true value", f"largest of ours, {SIZE} px", f"largest of ours, {SMALLER} px",
    )  # fmt: skip
    rows = []
    for name in ("u", "v", "exx", "exy"):
        values = {key: np.asarray(getattr(field, name)) for key, field in fields.items()}
        filtered = for_display(values["whole"], step) if name[0] == "e" else values["whole"]
        unit = "um/m" if name[0] == "e" else "px"
        scale = 1e6 if unit == "um/m" else 1.0
        each = [
            _rms(v, truth[name])
            for v in (values["paper"], values["whole"], filtered, values["ours"], values["fine"])
        ]
        peaks = [float(np.nanmax(v)) for v in (truth[name], values["ours"], values["fine"])]
        rows.append((f"rms error of {name}, {unit}", *(scale * v for v in each), *(scale * v for v in peaks)))
    return ResultTable("woven", columns, tuple(rows))


def _rms(values: Floats, truth: Floats) -> float:
    return float(np.sqrt(np.nanmean((values - truth) ** 2)))


def _verdicts(table: ResultTable) -> tuple[Comparison, ...]:
    return tuple(
        verdict(f"{row[0]}, woven".replace(", um/m", "").replace(", px", ""), row[0].split()[-1], row[4], row[3],
                "the paper's estimator with its filters")
        for row in table.rows
    )  # fmt: skip


def _draw_woven(
    context: ExperimentContext, fields: dict[str, Any], truth: dict[str, Floats], step: int
) -> str:
    drawn = figure(14, 6.2)
    axes = drawn.subplots(2, 4)
    for row, name in enumerate(("exx", "exy")):
        low, high = 1e6 * float(truth[name].min()), 1e6 * float(truth[name].max())
        limits = (low - 0.1 * (high - low), high + 0.1 * (high - low))
        maps = [
            (truth[name], "truth"), (getattr(fields["ours"], name), f"ours, {SIZE} px, unfiltered"),
            (getattr(fields["paper"], name), f"the paper's estimator, {SIZE} px"),
            (for_display(getattr(fields["whole"], name), step), "the same by whole pixels, filtered"),
        ]  # fmt: skip
        for place, (values, title) in zip(axes[row], maps, strict=True):
            colour_map(place, 1e6 * values, f"{name}, {title}", "um/m", limits)
    return save_figure(context, "fig7_woven.png", drawn)


def _woven_text(table: ResultTable, name: str) -> str:
    return f"""A plain weave with a cell of {CELL:g} px, {1e6 * MEAN_STRAIN:g} um/m in the mean along x and
{100 * OVER:g} % more where the yarns cross; 12 bit, {NOISE:g} GL of noise (16 frames of 20 GL averaged). The paper's
maps are filtered (3x3 median, then Gaussian with sigma = {PAPER_LOW_PASS:g} px); ours are drawn as measured. Here
such filters exist for pictures and exports only (`phasedic map --median 3 --low-pass 9`) and never touch stored
values. A displacement of a fifth of a pixel is enough for the overlay by linear interpolation, as printed, to spoil the
paper's strain; overlaid by whole pixels, as its section 2.2 may be read, it shows the weave.

{table.markdown()}

![Strain maps of the simulated weave]({name})"""


def open_hole(context: ExperimentContext) -> ExperimentOutcome:
    """The open-hole composite of the DIC Challenge 1.0 (sample 12), a real test."""
    if context.data is None or not (context.data / HOLE).is_dir():
        text = "Left out: give the folder of the DIC Challenge image sets with `--data DIR`."
        return ExperimentOutcome("open-hole", "Section 4.2: a real composite with a hole", text)
    pictures = [read_image(context.data / HOLE / name, gray="luma") for name in HOLE_FRAMES]
    step = 16 if context.quick else 8
    mask = _specimen(pictures[0])
    grids = {size: ZoiGrid.cover(HOLE_ROI, size, step, mask) for size in (48, 32)}
    fields: list[StrainField] = []
    for number, picture in enumerate(pictures[1:]):
        fields.append(ours((pictures[0], picture), grids[48], None))
        context.tick(0.2 * (number + 1))
    paper = papers((pictures[0], pictures[1]), grids[48], PaperSettings(search_px=12))
    whole = papers((pictures[0], pictures[1]), grids[48], WHOLE)
    context.tick(0.9)
    gold = _against_gold(
        context.data / HOLE / "DICe_solution_04.txt", ours((pictures[0], pictures[1]), grids[32], None)
    )
    name = _draw_hole(context, pictures[0], fields[0], paper, whole)
    columns = (
        "frame", "ZOIs on the specimen", "measured", "mean eyy um/m", "largest eyy um/m", "smallest eyy um/m",
        "predicted sigma of eyy um/m",
    )  # fmt: skip
    rows = tuple(_hole_row(frame, field) for frame, field in zip(HOLE_FRAMES[1:], fields, strict=True))
    table = ResultTable("open_hole", columns, rows)
    return ExperimentOutcome(
        "open-hole",
        "Section 4.2: a real composite with a hole",
        _hole_text(table, name, gold),
        (table,),
        (name,),
    )


def _hole_row(frame: str, field: StrainField) -> tuple[Any, ...]:
    extremes = (1e6 * float(np.nanmax(field.eyy)), 1e6 * float(np.nanmin(field.eyy)))
    sigma = 1e6 * float(np.nanmedian(field.sigma_eyy))
    return frame, field.grid.n_active, field.n_valid, 1e6 * field.mean("eyy")[0], *extremes, sigma


def _specimen(picture: NDArray[Any]) -> NDArray[np.bool_]:
    """Where there is specimen: not the hole, which is dark over a large area."""
    from scipy.ndimage import binary_dilation, gaussian_filter

    dark = gaussian_filter(picture.astype(float), 6) < BACKGROUND
    return np.asarray(~binary_dilation(dark, iterations=4))


def _against_gold(path: Path, field: StrainField) -> str:
    """Displacements against those of DICe where its points lie on ours, in words."""
    from scipy.interpolate import RegularGridInterpolator

    header, *lines = [
        line for line in path.read_text(encoding="utf-8").splitlines() if not line.startswith("*")
    ]
    names = [name.strip() for name in header.split(",")]
    values = np.array([[float(v) for v in line.split(",")] for line in lines if line.strip()])
    at = dict(zip(names, values.T, strict=True))
    points = np.column_stack([at["COORDINATE_Y"], at["COORDINATE_X"]])
    differences = []
    for mine, theirs in ((field.u, "DISPLACEMENT_X"), (field.v, "DISPLACEMENT_Y")):
        there = RegularGridInterpolator((field.grid.y, field.grid.x), mine, bounds_error=False)(points)
        differences.append(np.abs(there - at[theirs]))
    common = np.isfinite(differences).all(axis=0)
    du, dv = (float(np.median(each[common])) for each in differences)
    return f"median |du| {shown(du)} px, |dv| {shown(dv)} px over {np.count_nonzero(common)} common points"


def _draw_hole(
    context: ExperimentContext, picture: NDArray[Any], field: StrainField, paper: Any, whole: Any
) -> str:
    drawn = figure(13, 6.4)
    axes = drawn.subplots(1, 4)
    step, size = field.grid.step, field.grid.size
    maps = [
        (field.v, "v, ours", "px", None), (1e6 * field.eyy, "eyy, ours, unfiltered", "um/m", None),
        (1e6 * paper.eyy, "eyy, the paper's estimator", "um/m", None),
        (1e6 * for_display(whole.eyy, step), "eyy, by whole pixels, filtered", "um/m", None),
    ]  # fmt: skip
    limits = tuple(float(v) for v in np.nanpercentile(maps[1][0], [1, 99]))
    extent = (
        field.grid.x[0] - step / 2,
        field.grid.x[-1] + step / 2,
        field.grid.y[-1] + step / 2,
        field.grid.y[0] - step / 2,
    )
    for place, (values, title, unit, _) in zip(axes.ravel(), maps, strict=True):
        place.imshow(picture, cmap="gray", alpha=0.6)
        drawn_map = colour_map(
            place, values, f"{title}\nZOI {size}", unit, limits if unit == "um/m" else None
        )
        drawn_map.set_extent(extent)
        place.set(xlim=(0, picture.shape[1]), ylim=(picture.shape[0], 0))
    return save_figure(context, "fig6_7_open_hole.png", drawn)


def _hole_text(table: ResultTable, name: str, gold: str) -> str:
    return f"""Open-hole tension of a carbon-fibre composite (DIC Challenge 1.0, sample 12; SEM/iDICs, images
from the DICe regression tests), 8 bit, one picture a step, ZOI 48, noise estimated from the
residual. No truth is known; DICe's own displacements at frame 04 against ours with 32 px: {gold}.

{table.markdown()}

![Maps over the picture of the open-hole composite]({name})"""
