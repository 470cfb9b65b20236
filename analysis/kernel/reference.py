"""A reference, made once and never changed: what every picture is measured against.

The first is made by ``ReferencePicture.first``, one that goes on from a later picture by ``renewed``.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from analysis.field import Roi, Status, StrainField, ZoiGrid, profile
from analysis.fit.kernel_args import StopArgs
from analysis.follow.renewal import Placement, place
from analysis.follow.repetition import Repetition
from analysis.kernel.images import Noise, NoiseModel, as_model, check_fit, clipped_pixels, rounding_variance
from analysis.kernel.prepared import PatternError, PreparedReference, prepare_reference
from analysis.kernel.quadrature import Sensors, make_sensors
from analysis.kernel.settings import KernelSettings
from analysis.kernel.white_noise import responses, white_cubic
from analysis.picture.impulses import without_impulses
from analysis.picture.splines import Box

if TYPE_CHECKING:
    from analysis.fit.sums import MeanNoise
    from analysis.fit.tiles import Tiles

Floats = NDArray[np.float64]
Image = NDArray[np.float32]
Places = NDArray[np.intp] | slice
"""Which of the active ZOIs."""
ALL = slice(None)

SPILL_PX = 0.5
"""How far a ZOI may stick out of the image. Farther, what is missing counts: two rows less of a 64 px
Gaussian ZOI gave 270 um/m, many times the predicted uncertainty."""
REACHED_PX, REACHED_SHARE = 12.0, 0.15
"""How far beyond the guess, in px and shares of a ZOI, an image is made ready; what goes farther needs all of it and is
measured again, so that no value depends on it. 121 ZOIs: 0.7 ms a frame in place of 2 (November 2026)."""
_AFFINE = ((0, 15), (6, 11, 18, 20))
"""Variances of u and v, and of the four gradients, among the 21 pairs."""


@dataclass(frozen=True, slots=True, eq=False)
class ReferencePicture:
    """One picture with everything that measuring against it needs; A active ZOIs.

    Attributes
    ----------
    grid : ZoiGrid
    settings : KernelSettings
    noise_model : NoiseModel or None
        As given; None: not given.
    image : (H, W) float32, GL
    region : Roi
        Where the ZOIs lie in the image, for the search.
    index : (A,)
        Flat places of the active ZOIs on the grid.
    prepared : PreparedReference
    sensors : Sensors or None
        For the estimator by phases.
    placement : Placement or None
        Of a renewed reference on the first.
    spacing : int, px
        Between ZOIs that follow each other in a row.
    tiles : Tiles
        Which ZOIs share a warp.
    sharpness : float
        Independent pixels a ZOI would have without a window, over the sum of its weights squared.
    unit_covariance : (21, R, C) float32
        For noise of variance 1 GL^2, on the grid.
    unit_sigma : (3, A) float64
        Smallest of u and v, smallest of the gradients, largest of u and v, for a noise of 1 GL.
    share_variance : (A, 2) float64, px^2
        Of u and v if nothing else were sought, for a noise of 1 GL.
    sums : MeanNoise or None
        Of the sensor form.
    rounding : float, GL^2
        Variance that rounding to whole grey levels leaves.
    white : (2,) float64
        ``white_noise.white_cubic``.
    cleaned : bool
        Whether it had wild pixels, which were replaced; later pictures are then cleaned, too.
    repetition : Repetition
        Where the ZOIs look like themselves (``repeating.repetition``).
    kept : dict
        By ZOIs, spectra of what they recorded (``coloured``).
    made_later : dict
        By name, what only some pictures need, and what the next one may (``solve.Stated``).
    """

    grid: ZoiGrid
    settings: KernelSettings
    noise_model: NoiseModel | None
    image: Image
    region: Roi
    index: NDArray[np.intp]
    prepared: PreparedReference
    sensors: Sensors | None
    placement: Placement | None
    spacing: int
    tiles: Tiles
    sharpness: float
    unit_covariance: NDArray[np.float32]
    unit_sigma: Floats
    share_variance: Floats
    sums: MeanNoise | None
    rounding: float
    white: Floats
    cleaned: bool
    repetition: Repetition
    kept: dict[bytes, NDArray[np.complex64]] = field(default_factory=dict, repr=False)
    made_later: dict[str, Any] = field(default_factory=dict, repr=False)

    @classmethod
    def first(
        cls,
        image: Image,
        grid: ZoiGrid,
        settings: KernelSettings,
        noise: Noise | None,
        clipped: NDArray[np.bool_] | None,
        least_noise: float = 0.0,
    ) -> ReferencePicture:
        """The reference of a test; parameters and what is raised as for ``PhaseKernel``."""
        check_fit(grid, image.shape)
        index = np.flatnonzero(grid.active)
        rows, columns = np.unravel_index(index, grid.shape)
        origins = np.stack([grid.first_y[rows], grid.first_x[columns]], axis=1).astype(np.int64)
        model = None if noise is None else as_model(noise)
        saturated = clipped_pixels(image, clipped, model)
        cleaned = without_impulses(image)
        whole = image if cleaned is None else cleaned
        prepared = prepare_reference(whole, origins, grid.size, settings, model, saturated, least_noise)
        _check_pattern(prepared.status)
        return _laid_out(whole, grid, settings, model, prepared, cleaned is not None)

    def renewed(
        self, image: Image, field: StrainField, noise: Noise | None, clipped: NDArray[np.bool_] | None
    ) -> ReferencePicture:
        """The reference that goes on from a later picture; parameters as for ``PhaseKernel.renewed``."""
        settings, size = self.settings, self.grid.size
        model = None if noise is None else as_model(noise)
        placement = place(field, self.index, self.modes, self.prepared.shape)
        saturated = clipped_pixels(image, clipped, model)
        cleaned = without_impulses(image)
        whole = image if cleaned is None else cleaned
        prepared = prepare_reference(
            whole, placement.origins, size, settings, model, saturated, self.prepared.least_noise
        )
        gone = placement.status != Status.OK
        prepared = replace(prepared, status=np.where(gone, placement.status, prepared.status))
        made = _laid_out(whole, self.grid, settings, model, prepared, cleaned is not None, placement)
        return replace(made, repetition=self.repetition)

    @property
    def response(self) -> Floats:
        """``white_noise.responses``, (8, n, n // 2 + 1)."""
        if "response" not in self.made_later:
            self.made_later["response"] = responses(self.prepared, self.grid.size, self.settings.order)
        response: Floats = self.made_later["response"]
        return response

    @property
    def period(self) -> Floats:
        """The smallest displacement at which each ZOI looks like itself, (A,), px; infinite: none."""
        return self.repetition.period

    @property
    def modes(self) -> int:
        """Parameters of a ZOI: 6 (order 1) or 12 (order 2)."""
        return 6 if self.settings.order == 1 else 12

    @property
    def affine(self) -> list[int]:
        """Where u, du_dx, du_dy, v, dv_dx, dv_dy stand among the parameters."""
        half = self.modes // 2
        return [0, 1, 2, half, half + 1, half + 2]

    @property
    def noise(self) -> float:
        """Standard deviation of the noise, GL, as given or as estimated."""
        return self.prepared.pattern.noise

    def tolerance(self, current: float) -> StopArgs:
        """When the iteration may stop, for a noise of ``current`` GL in the deformed image."""
        settings = self.settings
        share = settings.tolerance_sigma * np.hypot(current, self.noise)
        return StopArgs(
            length=np.maximum(share * self.unit_sigma[0], settings.tolerance_px),
            slope=np.maximum(share * self.unit_sigma[1], settings.tolerance_strain),
            trust=current * self.unit_sigma[2],
            max_iterations=settings.max_iterations,
        )

    @property
    def whole(self) -> Box:
        """All of the image."""
        height, width = self.prepared.shape
        return Box(0, height, 0, width)

    def reached(self, guess: Floats) -> Box:
        """The part of a deformed image that ZOIs with a guess (A, modes) will need, as a rule."""
        origins, half, size = self.prepared.origins, self.modes // 2, self.grid.size
        if len(guess) == 0:
            return self.whole
        more = REACHED_PX + REACHED_SHARE * size
        ends = [
            (np.fmin.reduce(at) - more, np.fmax.reduce(at) + size + more)
            for at in (origins[:, 0] + guess[:, half], origins[:, 1] + guess[:, 0])
        ]
        return Box.of(self.prepared.shape, *ends) if np.isfinite(ends).all() else self.whole

    def local(self, total: Floats, places: Places = ALL) -> Floats:
        """Parameters against this reference from those against the original one, (B, modes), of some ZOIs."""
        return total if self.placement is None else self.placement.at(places).locate(total)

    def total(self, local: Floats, places: Places = ALL) -> Floats:
        """Parameters against the original reference from those against this one, (B, modes), of some ZOIs."""
        return local if self.placement is None else self.placement.at(places).compose(local)

    def all_modes(self, affine: Floats) -> Floats:
        """Parameters (A, modes) from the six affine ones, (A, 6); the others are zero."""
        out = np.zeros((len(affine), self.modes))
        out[:, self.affine] = affine
        return out

    def searched(self, image: NDArray[Any], room: NDArray[np.float32] | None = None) -> Floats:
        """Where each ZOI is in a deformed image, from nothing: right to about a pixel, (A, modes).

        ``room`` is memory for the image at least; by default its own.
        """
        from analysis.follow.search import search

        offset = np.float32(self.prepared.pattern.mean)
        origins, deformed = self.prepared.origins, image
        if image.dtype != np.float32:
            deformed = (
                np.empty(image.shape, np.float32) if room is None else room[: image.size].reshape(image.shape)
            )
            deformed[:] = image
        return self.all_modes(search(self.image, deformed, offset, self.region, origins, self.grid.size))

    def searched_near(self, image: NDArray[Any], which: NDArray[np.intp], reach: float) -> Floats:
        """The same for some ZOIs (B,) that are not farther than ``reach`` px from where they were, (B, modes)."""
        from analysis.follow.search import search

        origins, size = self.prepared.origins[which], self.grid.size
        first, last = origins.min(axis=0), origins.max(axis=0) + size
        top, left = np.maximum(first - int(reach), 0)
        bottom, right = last + int(reach)
        part = np.s_[top:bottom, left:right]
        box = Roi(int(first[1] - left), int(first[0] - top), *(int(n) for n in (last - first)[::-1]))
        offset = np.float32(self.prepared.pattern.mean)
        deformed = np.ascontiguousarray(image[part], np.float32)
        reference = np.ascontiguousarray(self.image[part])
        return self.all_modes(search(reference, deformed, offset, box, origins - (top, left), size))

    def spread(self, values: NDArray[Any], empty: float = np.nan) -> NDArray[Any]:
        """(A, K) onto the grid: (K, R, C); where all ZOIs are active, the same memory."""
        return _spread(values, self.index, self.grid.shape, empty)


def _laid_out(
    image: Image,
    grid: ZoiGrid,
    settings: KernelSettings,
    model: NoiseModel | None,
    prepared: PreparedReference,
    cleaned: bool,
    placement: Placement | None = None,
) -> ReferencePicture:
    """What every frame needs of a prepared picture, once."""
    from analysis.fit.tiles import Tiles

    line = profile(settings.window, grid.size)
    sensors = None
    if settings.estimator == "phase":
        sensors = make_sensors(prepared, line, grid.size)
        prepared = replace(prepared, covariance=sensors.covariance)
    sharpness = float((line.sum() / (line @ line)) ** 2)
    index = np.flatnonzero(grid.active)
    spacing = _spacing(prepared.origins, grid.step)
    lengths, slopes = (np.sqrt(np.maximum(prepared.covariance[:, k].astype(np.float64), 0)) for k in _AFFINE)
    unit_covariance = np.ascontiguousarray(_spread(prepared.covariance, index, grid.shape, 0))
    share_variance = 1 / np.maximum(prepared.weight * sharpness * prepared.energy, 1e-12)
    return ReferencePicture(
        grid=grid,
        settings=settings,
        noise_model=model,
        image=image,
        region=grid.roi if placement is None else placement.region(grid.size, prepared.shape),
        index=index,
        prepared=prepared,
        sensors=sensors,
        placement=placement,
        spacing=spacing,
        tiles=Tiles.of(prepared.origins, grid.size, spacing),
        sharpness=sharpness,
        unit_covariance=unit_covariance,
        unit_sigma=np.stack([lengths.min(1), slopes.min(1), lengths.max(1)]),
        share_variance=share_variance,
        sums=None if sensors is not None else _sums(grid, settings, index, prepared, unit_covariance),
        rounding=rounding_variance(image),
        white=white_cubic(prepared, grid.size, settings.order, share_variance),
        cleaned=cleaned,
        repetition=Repetition.none(len(index)),
    )


def _sums(
    grid: ZoiGrid,
    settings: KernelSettings,
    index: NDArray[np.intp],
    prepared: PreparedReference,
    unit_covariance: NDArray[np.float32],
) -> MeanNoise:
    from analysis.fit.sums import MeanNoise

    return MeanNoise(
        grid, settings.window, settings.order, prepared.status == Status.OK, index, prepared.origins,
        prepared.images, prepared.inverse, unit_covariance,
    )  # fmt: skip


def _spacing(origins: NDArray[np.int64], step: int) -> int:
    """The smallest distance in a row of ZOIs that follow each other; ``step`` where no two do."""
    beside = np.diff(origins, axis=0)
    gaps = beside[(beside[:, 0] == 0) & (beside[:, 1] > 0), 1]
    return int(gaps.min()) if len(gaps) else step


def _spread(
    values: NDArray[Any], index: NDArray[np.intp], shape: tuple[int, int], empty: float
) -> NDArray[Any]:
    rows, columns = shape
    if len(index) == rows * columns:
        return values.T.reshape(-1, rows, columns)
    out = np.full((values.shape[1], rows * columns), empty, values.dtype)
    out[:, index] = values.T
    return out.reshape(-1, rows, columns)


def _check_pattern(status: NDArray[np.uint8]) -> None:
    if len(status) == 0:
        raise ValueError("no ZOI of the grid is active: the mask or the selection leaves nothing to measure")
    if np.all(status == Status.NO_PATTERN):
        raise PatternError(
            "the reference shows no pattern that could be followed in any ZOI; "
            "check focus, exposure, speckle and compression, or take larger ZOIs"
        )
