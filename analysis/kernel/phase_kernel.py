"""The phase kernel: one reference, and any number of deformed images measured against it.

Phase Gauss-Newton in its sensor form (docs/method.md). ``PhaseKernel`` joins the parts: start,
warp and iteration, judgement, uncertainty. It reads no file, no clock and no device, and its
numbers for a ZOI depend on the two images, the settings and that ZOI's own start alone.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from copy import copy
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis.compiled.forked import FORK_CHECK
from analysis.field import PAIR_INDEX, Motion, StrainField, ZoiGrid, profile
from analysis.follow.parts import coherent
from analysis.follow.renewal import taken
from analysis.kernel.images import (
    Noise,
    as_image,
    as_model,
    as_recorded,
    clipped_pixels,
    with_second_differences,
)
from analysis.kernel.lines import mend
from analysis.kernel.quadrature import zois_of
from analysis.kernel.reference import ReferencePicture
from analysis.kernel.repeating import repetition
from analysis.kernel.result import PredictedMotion, field_of
from analysis.kernel.retry import retry_lost
from analysis.kernel.settings import Estimator, KernelSettings
from analysis.kernel.solve import Solution
from analysis.self_test import SelfTestCase, check

Floats = NDArray[np.float64]


class PhaseKernel:
    """Measures displacement and strain of every ZOI of a grid against one reference.

    For one thread at a time, whatever the number of kernels: their loops use all cores, and where
    numba finds neither OpenMP nor TBB it ends a program in which two of them run at once. A process
    forked off after a kernel was made cannot measure (RuntimeError): start processes by "spawn".

    Parameters
    ----------
    reference : (H, W) uint8, uint16 or float32, GL
        A frame or the mean of a burst; the kernel keeps a copy.
    grid : ZoiGrid
    settings : KernelSettings, optional
    noise : float (GL, std of the reference as given) or NoiseModel, optional
        None: taken from the spectrum of the reference.
    clipped : (H, W) bool, optional
        Saturated pixels of the reference; found from ``noise.saturation`` where that is given.
    least_noise : float, GL
        What is below it is no pattern (``hidden_noise`` of compressed pictures).

    Attributes
    ----------
    reference : ReferencePicture
        Everything that does not change from frame to frame.

    Raises
    ------
    ValueError
        The grid leaves the image, or an array of the wrong kind.
    PatternError
        No ZOI has a pattern.
    MachineError
        This machine measures a known pattern wrong (``check_machine``, once a process and kind of ZOI).
    """

    reference: ReferencePicture

    def __init__(
        self,
        reference: ArrayLike,
        grid: ZoiGrid,
        settings: KernelSettings | None = None,
        noise: Noise | None = None,
        clipped: NDArray[np.bool_] | None = None,
        least_noise: float = 0.0,
    ) -> None:
        from analysis.picture.prefilter import room_for

        FORK_CHECK.check()
        image = as_image(reference, "the reference")
        made = ReferencePicture.first(image, grid, settings or KernelSettings(), noise, clipped, least_noise)
        self.reference = replace(made, repetition=repetition(made))
        self._rooms = [room_for(image.shape)]
        check_machine(self.settings, grid.size)

    @property
    def period(self) -> Floats:
        """Smallest displacement at which a ZOI looks like itself, (R, C), px; infinite: none, NaN: not active."""
        return np.asarray(self.reference.spread(self.reference.period[:, None])[0])

    @property
    def grid(self) -> ZoiGrid:
        return self.reference.grid

    @property
    def settings(self) -> KernelSettings:
        return self.reference.settings

    @property
    def reference_noise(self) -> float:
        """Standard deviation of the noise of the reference, GL, as given or as estimated."""
        return self.reference.noise

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
        image, shape = as_image(new_reference, "the new reference"), self.reference.prepared.shape
        if image.shape != shape:
            raise ValueError(f"the new reference has the shape {image.shape}, the first {shape}")
        if not self.grid.is_at(field.grid):
            raise ValueError(f"the field is of {field.grid}, this kernel of {self.grid}")
        if not field.ok.any():
            raise ValueError("the reference cannot be renewed from a field without a single valid ZOI")
        if noise is None and np.isfinite(field.noise):
            noise = field.noise
        kernel = copy(self)
        kernel.reference = self.reference.renewed(image, field, noise, clipped)
        return kernel

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
            NaN with a reason wherever a ZOI is not valid.

        Raises
        ------
        ValueError
            The image has another size than the reference or values that are not finite, or the start another grid.
        """
        FORK_CHECK.check()
        reference = self.reference
        later = start is not None and not reference.cleaned  # when the image is filtered
        image = as_recorded(deformed, "the deformed image", any_values=later)
        shape = reference.prepared.shape
        if image.shape != shape:
            raise ValueError(
                f"the deformed image has {image.shape[1]} x {image.shape[0]} px, "
                f"the reference {shape[1]} x {shape[0]}"
            )
        model = None if noise is None else as_model(noise)
        saturated = clipped_pixels(image, clipped, model)
        with self._room() as room:
            if start is None:
                solution = Solution(reference, image, model, reference.searched(image, room), room)
                mend(solution)
                retry_lost(solution, None, saturated)
                return coherent(field_of(solution))
            before, carried = self._before(start), self._carried_motion(start)
            predicted = before + carried.ahead
            solution = Solution(reference, image, model, reference.local(predicted), room)
            mend(solution)
            retry_lost(solution, reference.local(before), saturated)
            return coherent(field_of(solution, PredictedMotion(predicted, carried)))

    @contextmanager
    def _room(self) -> Iterator[NDArray[np.float32]]:
        """Memory for the coefficients of one picture; another thread that measures meanwhile takes its own."""
        from analysis.picture.prefilter import room_for

        try:
            room = self._rooms.pop()
        except IndexError:
            room = room_for(self.reference.prepared.shape)
        try:
            yield room
        finally:
            self._rooms.append(room)

    def _before(self, start: StrainField) -> Floats:
        """Parameters of the field before, (A, modes); NaN for a ZOI without."""
        if not self.grid.is_at(start.grid):
            raise ValueError(f"the start is of {start.grid}, this kernel of {self.grid}")
        return taken(start.parameters, self.reference.index, self.reference.modes)

    def _carried_motion(self, start: StrainField) -> Motion:
        """The motion that the field before predicts."""
        index, modes = self.reference.index, self.reference.modes
        motion = start.motion
        if motion is not None and motion.fits(index, modes):
            return motion
        return Motion.none(index, modes)


def check_machine(settings: KernelSettings, size: int) -> None:
    """Refuse a machine that measures a known pattern wrong, once a process and kind of ZOI; a few ms.

    Every ``PhaseKernel`` calls it. Tolerances, the limit of the iterations and ``bending_px`` are the defaults,
    whatever the settings.

    Parameters
    ----------
    settings : KernelSettings
    size : int, px
        Side of a ZOI.

    Raises
    ------
    MachineError
        Motion or strain is out of limits. The message names what is wrong, and the libraries.
    """
    FORK_CHECK.check()
    check(
        _measure_known,
        SelfTestCase(settings.window, settings.estimator, settings.order, settings.interpolant, size),
    )


def _measure_known(
    reference: NDArray[np.float32], deformed: NDArray[np.float32], grid: ZoiGrid, case: SelfTestCase
) -> tuple[StrainField, NDArray[np.float32], float]:
    """As a new kernel measures its first picture; the gradients of the reference, (2, H, W); ``_sigma_off``."""
    estimator: Estimator = "phase" if case.estimator == "phase" else "spectral"
    settings = KernelSettings(case.window, estimator, case.order, case.interpolant)
    made = ReferencePicture.first(as_image(reference, "the pattern"), grid, settings, None, None)
    moved = as_recorded(deformed, "the moved pattern")
    solution = Solution(made, moved, None, made.searched(moved))
    retry_lost(solution, None)
    gradients = made.prepared.images[:2, : reference.shape[0], : reference.shape[1]]
    return field_of(solution), gradients, _sigma_off(made)


def _sigma_off(made: ReferencePicture) -> float:
    """Largest share by which sigma of a parameter of the first ZOI is off H^-1 (J' w w J) H^-1, with H = J' w J.

    Of the estimator by phases: off the squares of its sensors, which displacements are measured with.
    """
    from analysis.fit.sensitivity import columns, ridged

    ready, size = made.prepared, made.grid.size
    if made.sensors is not None:
        known = (made.sensors.weights[0, :6].astype(np.float64) ** 2).sum(axis=(1, 2))
    else:
        line, x = profile(made.settings.window, size), np.arange(size) - (size - 1) / 2
        channels = [zois_of(one, ready.origins[:1], size)[0] for one in with_second_differences(ready.images)]
        channels[3] = np.ones((size, size), np.float32)
        table = columns(made.settings.order)
        j = np.stack([channels[c] * (x / x[-1]) ** a * (x[:, None] / x[-1]) ** b for c, a, b in table])
        jw, flat = (j * line * line[:, None]).reshape(len(j), -1), j.reshape(len(j), -1)
        inverse = np.linalg.inv(ridged(jw @ flat.T))
        of_units = np.diag(inverse @ (jw @ jw.T) @ inverse)[made.affine]
        known = of_units / x[-1] ** (2 * table[made.affine, 1:].sum(1))
    found = ready.covariance[0, [PAIR_INDEX[k, k] for k in range(6)]]
    return float(np.abs(np.sqrt(found / known) - 1).max())
