"""What the scene is drawn with: colours, labels, lines, encoded images, and the geometry of ZOIs and arrows.

Positions are those of rerun, whose pixel (0, 0) covers 0..1: ours (its centre is 0) plus 0.5.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from acquire.cv2_loader import load_cv2
from acquire.text.quantity import Amount
from analysis.field import Status
from live.results.maps.colours import MICROSTRAIN
from live.ui.rerun.messages import STRAINS

if TYPE_CHECKING:
    from analysis.field import StrainField, ZoiGrid

GREY, DIM = (170, 175, 185), (62, 66, 74)
ORANGE, CYAN, YELLOW = (255, 169, 64), (64, 224, 255), (255, 212, 59)
BACKGROUND = (23, 29, 36)

Points = NDArray[np.float64]
_DOT = (255, 255, 255, 70)
_HEAD = 0.3, 0.15  # of an arrow: length and half the width
_MAX_BOXES, _MAX_ARROWS, _MAX_POINTS = 16, 240, 2000


def text_labels(positions: Any, texts: list[str], colour: Any = GREY) -> Any:
    """Texts, each below its position."""
    import rerun as rr

    return rr.Points2D(positions, labels=texts, colors=colour, radii=0.0, show_labels=True, draw_order=40)


def polylines(strips: Any, colour: tuple[int, int, int], radius: float) -> Any:
    """Polylines; thicker ones lie above."""
    import rerun as rr

    return rr.LineStrips2D(strips, colors=colour, radii=rr.Radius.ui_points(radius), draw_order=radius)


def reduced(image: NDArray[Any], bits: int, max_px: int) -> tuple[NDArray[np.uint8], int]:
    """An 8-bit picture of at most ``max_px``, and the whole factor of the reduction."""
    cv2 = load_cv2()
    factor = max(1, math.ceil(max(image.shape) / max_px))
    if factor > 1:
        size = image.shape[1] // factor, image.shape[0] // factor
        image = cv2.resize(image[: size[1] * factor, : size[0] * factor], size, interpolation=cv2.INTER_AREA)
    if bits != 8:
        image = cv2.convertScaleAbs(image, alpha=255.0 / (2**bits - 1))
    return image, factor


def centres(grid: ZoiGrid) -> Points:
    """(R, C, 2) centres of all ZOIs, px of the viewer."""
    x, y = np.meshgrid(np.asarray(grid.x, np.float64), np.asarray(grid.y, np.float64))
    positions: Points = np.stack([x, y], axis=-1) + 0.5
    return positions


def every(grid: ZoiGrid, max_count: int, min_distance_px: float = 0.0) -> tuple[slice, slice]:
    """Rows and columns of an evenly thinned grid of about ``max_count`` ZOIs at most, centred."""
    rows, columns = grid.active.shape
    step = max(math.ceil(math.sqrt(rows * columns / max_count)), math.ceil(min_distance_px / grid.step), 1)
    return _centred(rows, step), _centred(columns, step)


def _centred(count: int, step: int) -> slice:
    return slice((count - 1) % step // 2, None, step)


def sample_boxes(grid: ZoiGrid) -> Points:
    """(N, 2) centres of a few active ZOIs that do not overlap, spread over the grid."""
    pick = every(grid, _MAX_BOXES, 1.5 * grid.size)
    return np.asarray(centres(grid)[pick][grid.active[pick]])


def region_edges(grid: ZoiGrid) -> NDArray[np.float64]:
    """(N, 2, 2) straight segments (start, end) of the edge of the area that the active ZOIs cover, px."""
    unit = math.gcd(grid.size, grid.step)
    side, step = grid.size // unit, grid.step // unit
    rows, columns = grid.shape
    cover = np.zeros(((rows - 1) * step + side + 2, (columns - 1) * step + side + 2), np.int8)
    for row, column in np.argwhere(grid.active):
        top, left = row * step + 1, column * step + 1
        cover[top : top + side, left : left + side] = 1
    flat = _runs(np.diff(cover, axis=0) != 0)
    upright = _runs(np.diff(cover, axis=1).T != 0)[:, :, ::-1]
    # The covered area has a margin of one cell.
    return unit * (np.concatenate([flat, upright]) - 1.0) + [grid.roi.x, grid.roi.y]


def _runs(edges: NDArray[np.bool_]) -> NDArray[np.float64]:
    """(N, 2, 2) start and end, (along, across) cells, of each run of True in each row."""
    turns = np.diff(np.pad(edges, ((0, 0), (1, 1))).astype(np.int8))
    ends = [np.argwhere(turns == turn)[:, ::-1] + [0, 1] for turn in (1, -1)]
    return np.stack(ends, axis=1).astype(np.float64)


def thinned(grid: ZoiGrid, selected: NDArray[np.bool_]) -> Points:
    """(N, 2) centres of the selected ZOIs; every second, third ... where there are very many."""
    found = centres(grid)[selected]
    return np.asarray(found[:: max(1, math.ceil(len(found) / _MAX_POINTS))])


def mean_motion(field: StrainField) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The affine motion common to all valid ZOIs, as matrix (3, 3) and shift (3,) px.

    The maps lie on the reference picture; with it they follow the specimen on the present one.
    """
    valid = np.isfinite(field.u)
    if not valid.any():
        return np.eye(3), np.zeros(3)
    matrix = np.eye(3)
    gradients = (field.du_dx, field.du_dy, field.dv_dx, field.dv_dy)
    matrix[:2, :2] += np.array([float(p[valid].mean(dtype=np.float64)) for p in gradients]).reshape(2, 2)
    middle = centres(field.grid)[valid].mean(axis=0)
    moved = np.array([field.u[valid].mean(dtype=np.float64), field.v[valid].mean(dtype=np.float64)])
    shift = np.zeros(3)
    shift[:2] = middle + moved - matrix[:2, :2] @ middle
    return matrix, shift


class ArrowScale:
    """Displacement arrows, magnified by a round factor that rarely changes."""

    def __init__(self) -> None:
        self._factor = 0.0

    def arrows(self, field: StrainField) -> tuple[Points, Points, float]:
        """(N, 2) origins, (N, 2) vectors as drawn (px), and the factor of magnification."""
        pick = every(field.grid, _MAX_ARROWS)
        shown = np.stack([field.u[pick], field.v[pick]], axis=-1).astype(np.float64)
        valid = np.isfinite(shown).all(axis=-1)
        origins, vectors = centres(field.grid)[pick][valid], shown[valid]
        spacing = field.grid.step * (pick[0].step or 1)
        longest = float(np.percentile(np.hypot(*vectors.T), 95)) if len(vectors) else 0.0
        fits = (1.6 * spacing) / max(longest, 1e-3)
        if not fits / 5 < self._factor <= fits:
            self._factor = _round_below(min(fits, 1000.0))
        return origins, vectors * self._factor, self._factor


def with_heads(origins: Points, vectors: Points) -> NDArray[np.float32]:
    """(N, 5, 2): each arrow as one polyline with a head; the heads of rerun are too small."""
    tips, across = origins + vectors, vectors[:, ::-1] * [-1, 1]
    barbs = [tips - _HEAD[0] * vectors + side * _HEAD[1] * across for side in (1, -1)]
    return np.stack([origins, tips, barbs[0], tips, barbs[1]], axis=1).astype(np.float32)


def _round_below(value: float) -> float:
    decade = 10.0 ** math.floor(math.log10(value))
    return max(step for step in (1.0, 2.0, 5.0) if step * decade <= value * (1 + 1e-9)) * decade


def value_dots(field: StrainField) -> tuple[Any, Any]:
    """A dot for each ZOI with a label (shown under the pointer), and its numbers as components."""
    import rerun as rr

    active = np.asarray(field.grid.active, bool)
    numbers = {"u_px": field.u, "v_px": field.v}
    for name in STRAINS:
        numbers[f"{name}_um_m"] = getattr(field, name) * MICROSTRAIN.factor
        numbers[f"sigma_{name}_um_m"] = getattr(field, f"sigma_{name}") * MICROSTRAIN.factor
    found = {name: np.asarray(values[active], np.float64) for name, values in numbers.items()}
    positions, rows, columns = centres(field.grid)[active], *np.nonzero(active)
    labels = [
        _label(row, column, status, {name: values[k] for name, values in found.items()})
        for k, (row, column, status) in enumerate(
            zip(rows.tolist(), columns.tolist(), field.status[active].tolist(), strict=True)
        )
    ]
    dots = rr.Points2D(
        positions,
        radii=rr.Radius.ui_points(1.2),
        colors=_DOT,
        labels=labels,
        show_labels=False,
        draw_order=15,
    )
    return dots, rr.AnyValues(row=rows, column=columns, status=field.status[active], **found)


def _label(row: int, column: int, status: int, values: dict[str, float]) -> str:
    head = f"ZOI {row}, {column}"
    if status != Status.OK:
        return f"{head}: {Status(status).name}"
    strains = "\n".join(
        f"{n} {Amount('strain', values[f'{n}_um_m'] * 1e-6, values[f'sigma_{n}_um_m'] * 1e-6)}"
        for n in STRAINS
    )
    return f"{head}\nu {values['u_px']:+.4f}  v {values['v_px']:+.4f} px\n{strains}"
