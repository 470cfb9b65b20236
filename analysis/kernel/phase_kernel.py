"""The phase kernel: one reference, and any number of deformed images measured against it.

Phase Gauss-Newton in its sensor form (docs/method.md). ``PhaseKernel`` joins the parts: start,
warp and iteration, judgement, uncertainty. It reads no file, no clock and no device, and its
numbers for a ZOI depend on the two images, the settings and that ZOI's own start alone.
"""

from __future__ import annotations

import logging
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis.field import Motion, Status, StrainField, ZoiGrid, profile
from analysis.follow.renewal import Placement, place, taken
from analysis.kernel.attempt import Attempt
from analysis.kernel.images import as_image, as_recorded, check_fit, clipped_pixels
from analysis.kernel.noise import Noise, as_model
from analysis.kernel.prepared import PatternError, Prepared, prepare_reference
from analysis.kernel.quadrature import Sensors, make_sensors
from analysis.kernel.settings import KernelSettings

log = logging.getLogger("analysis")

Floats = NDArray[np.float64]

SPILL_PX = 0.5
"""How far a ZOI may stick out of the image. Farther, what is missing counts: two rows less of a 64 px
Gaussian ZOI gave 270 um/m, many times the predicted uncertainty."""


class PhaseKernel:
    """Measures displacement and strain of every ZOI of a grid against one reference.

    For one thread at a time, whatever the number of kernels: their loops use all cores, and where
    numba finds neither OpenMP nor TBB it ends a program in which two of them run at once.

    Parameters
    ----------
    reference : (H, W) uint8, uint16 or float32, GL
        A frame or the mean of a burst.
    grid : ZoiGrid
    settings : KernelSettings, optional
    noise : float (GL, std of the reference as given) or NoiseModel, optional
        None: taken from the spectrum of the reference.
    clipped : (H, W) bool, optional
        Saturated pixels of the reference; found from ``noise.saturation`` where that is given.

    Raises
    ------
    ValueError
        The grid leaves the image, or an array of the wrong kind.
    PatternError
        No ZOI has a pattern.
    """

    def __init__(
        self,
        reference: ArrayLike,
        grid: ZoiGrid,
        settings: KernelSettings | None = None,
        noise: Noise | None = None,
        clipped: NDArray[np.bool_] | None = None,
    ) -> None:
        image = as_image(reference, "the reference")
        check_fit(grid, image.shape)
        self._set_up(image, grid, settings or KernelSettings(), noise, clipped, None)
        self._check_pattern()

    def _set_up(
        self,
        image: NDArray[np.float32],
        grid: ZoiGrid,
        settings: KernelSettings,
        noise: Noise | None,
        clipped: NDArray[np.bool_] | None,
        placement: Placement | None,
    ) -> None:
        self.grid = grid
        self.settings = settings
        self._noise = None if noise is None else as_model(noise)
        self._index = np.flatnonzero(grid.active)
        self._placement = placement
        rows, columns = np.unravel_index(self._index, grid.shape)
        origins = np.stack([grid.first_y[rows], grid.first_x[columns]], axis=1).astype(np.int64)
        if placement is not None:
            origins = placement.origins
        self._prepared: Prepared = prepare_reference(
            image, origins, grid.size, self.settings, self._noise, clipped_pixels(image, clipped, self._noise)
        )
        self._reference = image
        self._region = grid.roi
        if placement is not None:
            self._region = placement.region(grid.size, self._prepared.shape)
            gone = placement.status != Status.OK
            self._prepared.status[gone] = placement.status[gone]
        self._sensors: Sensors | None = None
        if self.settings.estimator == "phase":
            line = profile(self.settings.window, grid.size)
            self._sensors = make_sensors(self._prepared, line, grid.size)
            self._prepared = replace(self._prepared, covariance=self._sensors.covariance)
        self._modes = 6 if self.settings.order == 1 else 12
        line = profile(self.settings.window, grid.size)
        self._sharpness = float((line.sum() / (line @ line)) ** 2)
        self._over = SPILL_PX
        self._lay_out()

    def _lay_out(self) -> None:
        """What every frame needs of the unit covariances, once: on the grid, and their roots."""
        rows, columns = self.grid.shape
        unit = np.zeros((21, rows * columns), np.float32)
        unit[:, self._index] = self._prepared.covariance.T
        self._unit = unit.reshape(21, rows, columns)
        variance = np.maximum(self._prepared.covariance[:, [0, 15, 6, 11, 18, 20]].astype(np.float64), 0)
        sigma = np.sqrt(variance)
        # Of u and v if nothing else were sought, for a noise of 1 GL.
        pixels = self._prepared.weight * self._sharpness
        self._share_variance = 1 / np.maximum(pixels * self._prepared.energy, 1e-12)
        # Smallest of u and v, smallest of the gradients, largest of u and v.
        self._unit_sigma = np.stack([sigma[:, :2].min(1), sigma[:, 2:].min(1), sigma[:, :2].max(1)], axis=1)
        self._tolerated: tuple[float, Floats, Floats] = np.nan, np.empty((0, 2)), np.empty(0)

    def _tolerance(self, current: float) -> tuple[Floats, Floats]:
        """Error that may be left in displacement and gradients, (A, 2), and uncertainty of u and v, (A,).

        ``current`` is the noise of the deformed image, GL; as a rule that of the frame before.
        """
        if current != self._tolerated[0]:
            share = self.settings.tolerance_sigma * np.hypot(current, self.reference_noise)
            floor = np.array([self.settings.tolerance_px, self.settings.tolerance_strain])
            allowed = np.maximum(share * self._unit_sigma[:, :2], floor)
            self._tolerated = current, allowed, current * self._unit_sigma[:, 2]
        return self._tolerated[1:]

    def _check_pattern(self) -> None:
        status = self._prepared.status
        if len(status) == 0:
            raise ValueError(
                "no ZOI of the grid is active: the mask or the selection leaves nothing to measure"
            )
        if np.all(status == Status.NO_PATTERN):
            raise PatternError(
                "the reference shows no pattern that could be followed in any ZOI; "
                "check focus, exposure and speckle, or take larger ZOIs"
            )

    def renewed(
        self,
        new_reference: ArrayLike,
        field: StrainField,
        noise: Noise | None = None,
        clipped: NDArray[np.bool_] | None = None,
    ) -> PhaseKernel:
        """A kernel that goes on from a later picture, with results against the original reference.

        Parameters
        ----------
        new_reference : (H, W) uint8, uint16 or float32, GL
            The picture that ``field`` was measured from.
        field : StrainField
            Measured by this kernel. Its uncertainty accumulates in all later results. A ZOI
            that is not OK there is lost for good, since nothing ties it to the original.
        noise : float or NoiseModel, optional
            Of the new reference; None: the noise that ``field`` was computed with.
        clipped : (H, W) bool, optional

        Raises
        ------
        ValueError
            An image of another size, a field of another grid, or one without a valid ZOI.
        """
        image = as_image(new_reference, "the new reference")
        if image.shape != self._prepared.shape:
            raise ValueError(
                f"the new reference has the shape {image.shape}, the first {self._prepared.shape}"
            )
        if field.grid.shape != self.grid.shape:
            raise ValueError(f"the field has {field.grid.shape} ZOIs, this kernel {self.grid.shape}")
        if not field.ok.any():
            raise ValueError("the reference cannot be renewed from a field without a single valid ZOI")
        if noise is None and np.isfinite(field.noise):
            noise = field.noise
        kernel = PhaseKernel.__new__(PhaseKernel)
        placement = place(field, self._index, self._modes, self._prepared.shape)
        kernel._set_up(image, self.grid, self.settings, noise, clipped, placement)
        return kernel

    @property
    def reference_noise(self) -> float:
        """Standard deviation of the noise of the reference, GL, as given or as estimated."""
        return self._prepared.pattern.noise

    def measure(
        self,
        deformed: ArrayLike,
        start: StrainField | None = None,
        noise: Noise | None = None,
        clipped: NDArray[np.bool_] | None = None,
    ) -> StrainField:
        """Measure one deformed image.

        Parameters
        ----------
        deformed : (H, W) uint8, uint16 or float32, GL
        start : StrainField, optional
            The field of the frame before; each ZOI starts from its own values there. None:
            every ZOI is searched for.
        noise : float (GL, std of this image as given) or NoiseModel, optional
            None: estimated from what the fit leaves, pooled over the ZOIs.
        clipped : (H, W) bool, optional
            Saturated pixels of this image.

        Returns
        -------
        StrainField
            NaN with a reason wherever a ZOI cannot be believed.

        Raises
        ------
        ValueError
            The image has another size than the reference, or the start another grid.
        """
        image = as_recorded(deformed, "the deformed image")
        if image.shape != self._prepared.shape:
            raise ValueError(
                f"the deformed image has {image.shape[1]} x {image.shape[0]} px, "
                f"the reference {self._prepared.shape[1]} x {self._prepared.shape[0]}"
            )
        model = None if noise is None else as_model(noise)
        attempt = Attempt(self, image, model)
        before = self._start_values(start)
        carried = self._carried_motion(start)
        predicted = None if before is None else before + carried.ahead
        attempt.run(self._searched(image) if predicted is None else self._local(predicted))
        attempt.rescue(None if before is None else self._local(before))
        return attempt.field(predicted, carried, clipped_pixels(image, clipped, model))

    def _start_values(self, start: StrainField | None) -> Floats | None:
        """Parameters of the field before, (A, modes); NaN for a ZOI without."""
        if start is None:
            return None
        if start.grid.shape != self.grid.shape:
            raise ValueError(f"the start has {start.grid.shape} ZOIs, this kernel {self.grid.shape}")
        return taken(start.parameters, self._index, self._modes)

    def _carried_motion(self, start: StrainField | None) -> Motion:
        """What the field before says of this one."""
        motion = None if start is None else start.motion
        if motion is not None and motion.fits(self._index, self._modes):
            return motion
        return Motion.none(self._index, self._modes)

    def _local(self, total: Floats) -> Floats:
        """Parameters against this reference from those against the original one."""
        return total if self._placement is None else self._placement.locate(total)

    def _total(self, local: Floats) -> Floats:
        """Parameters against the original reference from those against this one."""
        return local if self._placement is None else self._placement.compose(local)

    def _searched(self, recorded: NDArray[Any]) -> Floats:
        """Whole-pixel displacements of all ZOIs, (A, modes)."""
        from analysis.follow.climb import climb
        from analysis.follow.start import find_blocks

        image = recorded.astype(np.float32)
        ready, size = self._prepared, self.grid.size
        blocks = find_blocks(self._reference, image, self._region)
        centre = ready.origins + (size - 1) / 2
        plane = blocks.plane_at(centre[:, 0], centre[:, 1])
        around = blocks.around(centre[:, 0], centre[:, 1])
        candidates = np.rint(np.concatenate([plane[:, None, [0, 3]], around], axis=1)).astype(np.int64)
        offset = np.float32(ready.pattern.mean)
        found = np.zeros((len(centre), 2), np.int64)
        climb(
            self._reference - offset, image - offset, ready.origins, size,
            np.ascontiguousarray(candidates), found, np.zeros(len(centre)),
        )  # fmt: skip
        guess = np.zeros((len(centre), self._modes))
        half = self._modes // 2
        guess[:, 0], guess[:, half] = found[:, 0], found[:, 1]
        guess[:, 1:3], guess[:, half + 1 : half + 3] = plane[:, 1:3], plane[:, 4:6]
        return guess
