"""The apparent motion of the camera, measured on plates that move with the specimen and are not loaded.

Reference-sample compensation: B. Pan, L. Yu, D. Wu, Experimental Mechanics 53 (2013) 1751-1761. The fit is the
generalised least squares of ``analysis.evaluate.affine``, with the shapes of ``plane``.

One grid has the ZOIs of the specimen and of the plates beside it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from acquire.text import Message
from analysis.evaluate import AreaStrain
from analysis.evaluate.affine import Places, covariance_of
from analysis.field import Block, CommonError, Roi, StrainField, ZoiGrid, fixed_sums, part_of
from analysis.optics.plane import KEYSTONE, MODELS, STRETCH, ApparentMotion, Model, affine_values, shapes

Box = tuple[float, float, float, float]
MIN_ZOIS = 2
"""Rows and columns of ZOIs that a plate needs."""


@dataclass(frozen=True, slots=True, eq=False)
class PlateLayout:
    """One grid for the kernel, and its parts.

    Attributes
    ----------
    whole : ZoiGrid
    specimen : ZoiGrid
        That of the test.
    here : Block
        Of the specimen in ``whole``.
    plates : mapping of name to Block
    """

    whole: ZoiGrid
    specimen: ZoiGrid
    here: Block
    plates: Mapping[str, Block]

    @classmethod
    def of(cls, grid: ZoiGrid, boxes: Mapping[str, Box]) -> PlateLayout:
        """Layout for the grid of a test (``without_plates``) and the ``boxes`` (x, y, width, height, px) of the plates.

        Raises
        ------
        ValueError
            A plate is too small for ZOIs, or two of them overlap.
        """
        spans = {name: _span(name, grid, box) for name, box in boxes.items()}
        rows, columns = grid.shape
        top, left = (min(0, *(span[k][0] for span in spans.values())) for k in (0, 1))
        bottom, right = (
            max(size, *(span[k][1] for span in spans.values())) for k, size in ((0, rows), (1, columns))
        )
        roi = Roi(
            grid.roi.x + left * grid.step,
            grid.roi.y + top * grid.step,
            (right - left - 1) * grid.step + grid.size,
            (bottom - top - 1) * grid.step + grid.size,
        )
        blocks = {name: _block(span, top, left) for name, span in spans.items()}
        here = _block(((0, rows), (0, columns)), top, left)
        active = np.zeros((bottom - top, right - left), bool)
        active[here.at] = grid.active
        taken = np.zeros(active.shape, int)
        for block in blocks.values():
            active[block.at] = True
            taken[block.at] += 1
        if taken.max() > 1:
            raise ValueError("two plates overlap; move one")
        if not grid.active.any():
            raise ValueError("the plates cover the whole region to measure; move them beside it")
        return cls(ZoiGrid(roi, grid.size, grid.step, active), grid, here, blocks)


def _span(name: str, grid: ZoiGrid, box: Box) -> tuple[tuple[int, int], tuple[int, int]]:
    """First row and the row behind the last, and columns, of the lattice of ``grid`` wholly in ``box``."""
    x, y, width, height = box

    def along(start: float, side: float, origin: int) -> tuple[int, int]:
        first = math.ceil((start - origin) / grid.step)
        return first, math.floor((start + side - grid.size - origin) / grid.step) + 1

    rows, columns = along(y, height, grid.roi.y), along(x, width, grid.roi.x)
    if min(rows[1] - rows[0], columns[1] - columns[0]) < MIN_ZOIS:
        text = Message(
            "plate {name} of {width:g} x {height:g} px has no room for {n} x {n} ZOIs of {size} px; make it larger",
            *(name, width, height, MIN_ZOIS, grid.size),
        )
        raise ValueError(text)
    return rows, columns


def _block(span: tuple[tuple[int, int], tuple[int, int]], top: int, left: int) -> Block:
    (first, last), (begin, end) = span
    return Block(slice(first - top, last - top), slice(begin - left, end - left))


def without_plates(grid: ZoiGrid, boxes: Mapping[str, Box]) -> ZoiGrid:
    """The same grid without the ZOIs that have a pixel on a plate."""
    touching = np.zeros(grid.shape, bool)
    for x, y, width, height in boxes.values():
        columns = (grid.first_x + grid.size > x) & (grid.first_x < x + width)
        rows = (grid.first_y + grid.size > y) & (grid.first_y < y + height)
        touching |= rows[:, None] & columns
    return grid.subset(active=~touching)


Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

ASSUMED_TILT = ASSUMED_SQUARENESS = math.radians(0.1)
"""For the choice of the model: tilt during a test, and of the camera to the specimen, rad."""
MIN_VALID = 0.5
"""Share of the ZOIs of each plate that need a value."""
LOADED_SIGMAS, LOADED_STRAIN = 4.0, 5e-5
"""A plate is loaded where its own strain is beyond both together; a camera that is not square makes the latter."""
_UNEVEN_SIGMAS, _UNEVEN_PX = 5.0, 0.02
_ROUNDS = 6  # of Gauss-Newton; each leaves about a thousandth
_VARIANCES = [0, 15]  # of u and v among the 21 pairs


class _Weights(NamedTuple):
    """Weights of one plate and model: (K, 6, R, C), and what the variances of u and v add, (K, K, 2, R, C)."""

    weights: Floats
    noise: Floats


class PlateFit:
    """Fits the apparent motion to plates.

    Parameters
    ----------
    layout : PlateLayout
    axis : (x, y), px
        Where the optical axis meets the picture: the keystone of a tilt has its centre there.
    """

    def __init__(self, layout: PlateLayout, axis: tuple[float, float]) -> None:
        self.layout, self.centre = layout, axis
        self.length = math.hypot(layout.whole.roi.width, layout.whole.roi.height) / 2
        self._still = ApparentMotion(np.zeros(8), self.centre, self.length)
        self._kept: dict[tuple[str, int, bytes], dict[str, _Weights]] = {}

    def nothing(self) -> tuple[ApparentMotion, Floats]:
        """No apparent motion, without uncertainty, as ``motion`` gives it."""
        return self._still, np.zeros((8, 8))

    def shapes_of(self, field: StrainField) -> Floats:
        """What each parameter does to the ZOIs of ``field``, (8, 6, R, C)."""
        return shapes(*self._still.places(field), self.length)

    def motion(self, field: StrainField, model: Model) -> tuple[ApparentMotion, Floats]:
        """The apparent motion in a field of the whole layout, and its covariance (8, 8)."""
        count, plates = MODELS[model], self._parts(field)
        weights = self._weights(plates, count)
        found = np.zeros(8)
        for _ in range(_ROUNDS):
            motion = ApparentMotion(found, self.centre, self.length)
            step = np.zeros(count)
            for name, plate in plates.items():
                left = np.where(plate.ok, affine_values(plate) - motion.at(*motion.places(plate)), 0.0)
                step += fixed_sums((weights[name].weights * left).reshape(count, -1))
            found = found + np.pad(step, (0, 8 - count))
        return ApparentMotion(found, self.centre, self.length), self._covariance(plates, weights, count)

    def error(self, field: StrainField, covariance: Floats) -> CommonError:
        """What the noise of the parameters makes of the ZOIs of ``field``."""
        return CommonError(self.shapes_of(field), covariance)

    def leaks(self, field: StrainField, model: Model) -> Floats:
        """What parameters fake that are not of the model, by those of the model: (8, 8), rows of the latter."""
        count, plates = MODELS[model], self._parts(field)
        weights, out = self._weights(plates, count), np.zeros((8, 8))
        for name, plate in plates.items():
            made = np.where(plate.ok, self.shapes_of(plate), 0.0)
            out[:count] += np.einsum("jirc,kirc->jk", weights[name].weights, made)
        return out

    def _parts(self, field: StrainField) -> dict[str, StrainField]:
        return {name: part_of(field, block) for name, block in self.layout.plates.items()}

    def _weights(self, plates: Mapping[str, StrainField], count: int) -> dict[str, _Weights]:
        valid = b"".join(plate.ok.tobytes() for plate in plates.values())
        key = next(iter(plates.values())).window, count, valid
        if key not in self._kept:
            if len(self._kept) > 8:
                self._kept.clear()
            self._kept[key] = self._solved({name: (plate, plate.ok) for name, plate in plates.items()}, count)
        return self._kept[key]

    def _solved(self, plates: Mapping[str, tuple[StrainField, Bools]], count: int) -> dict[str, _Weights]:
        """The weights of all ZOIs without those that are not valid, normalised, as ``affine_weights``."""
        kept, normal = {}, np.zeros((count, count))
        for name, (plate, valid) in plates.items():
            design = self.shapes_of(plate)[:count].reshape(count, 2, 3, *plate.grid.shape)
            model = covariance_of(Places.of(plate.grid, plate.window))
            kept[name] = model.solve(design, np.ones(plate.grid.shape, bool)) * valid
            normal += np.einsum("acjyx,bcjyx->ab", kept[name], design)
        inverse, out = np.linalg.inv(normal), {}
        for name, (plate, _) in plates.items():
            model = covariance_of(Places.of(plate.grid, plate.window))
            weights = np.einsum("ab,bcjyx->acjyx", inverse, kept[name])
            noise = np.einsum("acjyx,bcjyx->abcyx", weights, model.times(weights)) / model.displacement
            weights = weights.reshape(count, 6, *plate.grid.shape)
            beyond = _beyond_overlap(plate, weights, noise)
            out[name] = _Weights(weights, noise * np.multiply.outer(beyond, beyond)[..., None, None, None])
        return out

    def _covariance(
        self, plates: Mapping[str, StrainField], weights: Mapping[str, _Weights], count: int
    ) -> Floats:
        found = np.zeros((count, count))
        for name, plate in plates.items():
            variances = np.where(plate.ok, plate.covariance[_VARIANCES].astype(np.float64), 0.0)
            products = (weights[name].noise * variances).reshape(count * count, -1)
            found += fixed_sums(products).reshape(count, count)
        return np.pad(found, (0, 8 - count))


def _beyond_overlap(plate: StrainField, weights: Floats, noise: Floats) -> Floats:
    """Noise of each parameter that the pattern makes, over that of the overlap of windows, (K,)."""
    count, at = len(weights), np.arange(plate.grid.active.size)
    if plate.sums is None:
        return np.ones(count)
    unit = np.where(plate.ok.ravel(), plate.sums.unit_variances(at), 0.0)
    made = [plate.sums.variance(at, weights[k].reshape(6, -1)) for k in range(count)]
    expected = [float(np.sum(noise[k, k].reshape(2, -1) * unit)) for k in range(count)]
    return np.asarray(np.sqrt(np.array(made) / np.array(expected)))


@dataclass(frozen=True, slots=True)
class ChosenModel:
    """A model with the standard uncertainties that it leaves in the mean strain of the specimen.

    Attributes
    ----------
    model : "scale", "pose" or "homography"
    noise : float
        By the noise of the plates in one burst.
    unseen : float
        By the assumed tilt and squareness, where the model does not have them.
    """

    model: Model
    noise: float
    unseen: float

    @property
    def total(self) -> float:
        return math.hypot(self.noise, self.unseen)


def choose_model(fit: PlateFit, field: StrainField, focal_px: float) -> ChosenModel:
    """The model that leaves the smallest uncertainty in the mean strain of the specimen.

    Parameters
    ----------
    fit : PlateFit
    field : StrainField
        Of the whole layout, with a value on each plate.
    focal_px : float, px
        Distance of the camera over the size of a pixel on the specimen.
    """
    priors = np.zeros(8)
    priors[[*KEYSTONE]] = ASSUMED_TILT * fit.length / focal_px
    priors[[*STRETCH]] = ASSUMED_TILT * math.sin(ASSUMED_SQUARENESS)
    specimen = part_of(field, fit.layout.here, fit.layout.specimen)
    made = fit.shapes_of(specimen)[:, [1, 5]][..., specimen.grid.active].mean(axis=-1)  # exx and eyy
    found = []
    for model, count in MODELS.items():
        _, covariance = fit.motion(field, model)
        noise = np.einsum("kc,kl,lc->c", made, covariance, made)
        left = (made - fit.leaks(field, model).T @ made)[count:] * priors[count:, None]
        found.append(
            ChosenModel(model, math.sqrt(float(noise.mean())), math.sqrt(float((left**2).sum(axis=0).mean())))
        )
    return min(found, key=lambda one: one.total)


def lost_plate(fit: PlateFit, field: StrainField) -> str:
    """Which plate has too few ZOIs with a value; empty where none."""
    for name, block in fit.layout.plates.items():
        ok = field.ok[block.at]
        if ok.sum() < MIN_VALID * ok.size:
            return Message(
                "plate {name} is lost or shaded: {n} of {all} ZOIs have a value",
                *(name, int(ok.sum()), ok.size),
            )
    return ""


def not_rigid(fit: PlateFit, field: StrainField) -> str:
    """Which plate does not move as a rigid one, and why; empty where all do."""
    motion, _ = fit.motion(field, "pose")
    for name, block in fit.layout.plates.items():
        plate = motion.removed_from(part_of(field, block))
        area = AreaStrain.of(plate)
        if area is None:
            continue
        # Noise of exx and eyy is the same, of their half difference less by the root of two.
        stretch, shear = (area.value("exx") - area.value("eyy")) / 2, area.value("exy")
        sigma = math.hypot(area.sigma("exx"), area.sigma("eyy")) / 2
        own = max(abs(stretch) - LOADED_SIGMAS * sigma, abs(shear) - LOADED_SIGMAS * area.sigma("exy"))
        if own > LOADED_STRAIN:
            return Message(
                "plate {name} is loaded or not flat: it is strained by {strain:.0f} um/m itself",
                name,
                math.hypot(stretch, shear) * 1e6,
            )
        if words := _uneven(name, plate):
            return words
    return ""


def _uneven(name: str, plate: StrainField) -> str:
    ok = plate.ok
    left = math.sqrt(float(np.mean(plate.u[ok] ** 2 + plate.v[ok] ** 2)) / 2)
    expected = math.sqrt(float(np.mean(plate.sigma_u[ok] ** 2 + plate.sigma_v[ok] ** 2)) / 2)
    if left <= _UNEVEN_PX + _UNEVEN_SIGMAS * expected:
        return ""
    return Message("plate {name} does not move with the others as one piece: {left:.3f} px", name, left)


def trouble(fit: PlateFit, field: StrainField) -> tuple[str, bool]:
    """Why the plates cannot be used in a field of the whole layout, and whether a plate is not rigid."""
    if words := lost_plate(fit, field):
        return words, False
    words = not_rigid(fit, field)
    return words, bool(words)
