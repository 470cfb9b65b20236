"""One image measured against a reference: every ZOI iterated from a guess and judged.

``retry`` tries lost ones again, ``result`` puts everything on the grid.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.field import Status, profile
from analysis.fit.kernel_args import (
    CONVERGED,
    LEFT_IMAGE,
    FitArgs,
    OutArgs,
    PictureArgs,
    PooledError,
    ReferenceArgs,
    StopArgs,
    VerdictArgs,
)
from analysis.fit.validity import CENTRE_VARIANCE, CLIPPED_SHARE, CORNER_STEPS
from analysis.kernel.images import NoiseModel, rounding_variance
from analysis.kernel.quadrature import Sensors
from analysis.kernel.reference import SPILL_PX, Places, ReferencePicture
from analysis.picture.splines import Box, prefilter_poles, tap_table

if TYPE_CHECKING:
    from analysis.fit.assembly import ExpectedNoise

Floats = NDArray[np.float64]

SAME_LIGHT = 1.0, 0.0
"""Gain and offset of an image in the light of the reference."""
DISTURBED_RATIO, DISTURBED_SHARE = 2.0, 0.02
"""Of what is left over what the noise explains, and of the ZOIs that are refused: from here on wild pixels of the
image are looked for."""


class Stated(NamedTuple):
    """What follows of a reference and of the noise of images as stated; A active ZOIs.

    Attributes
    ----------
    tolerance : StopArgs
        Where the iteration may stop.
    fit : FitArgs
        Of all ZOIs.
    known : ReferenceArgs
        What the verdict needs of each ZOI.
    able : (A,) bool
        Which ZOIs have a pattern, ...
    which : (B,)
        ... and their places.
    """

    tolerance: StopArgs
    fit: FitArgs
    known: ReferenceArgs
    able: NDArray[np.bool_]
    which: NDArray[np.intp]


class Solution:
    """Parameters and verdict of every active ZOI of one image, as they come.

    Parameters
    ----------
    reference : ReferencePicture
    image : (H, W) uint8, uint16 or float32, GL
    noise : NoiseModel or None
        Of the image; None: not known.
    guess : (A, modes)
        Every ZOI that has a pattern and a guess is measured; one without a guess is LOST.
    room : flat float32, optional
        Memory for the coefficients of the image (``prefilter.room_for``); by default its own.

    Attributes
    ----------
    found : OutArgs
        Of the iteration, for all A ZOIs; NaN where there was none.
    status : (A,) uint8
    stated : Stated
    common : PooledError or None
        What the fits leave in common; None: of too few ZOIs to be taken.
    retried : bool
        Whether ``keep`` has changed some ZOIs since.
    had_lines : bool
        Whether bands or lines were taken off the image (``lines.mend``).
    """

    def __init__(
        self,
        reference: ReferencePicture,
        image: NDArray[Any],
        noise: NoiseModel | None,
        guess: Floats,
        room: NDArray[np.float32] | None = None,
    ) -> None:
        from analysis.picture.prefilter import room_for

        prepared = reference.prepared
        self.reference = reference
        self.noise = noise
        self.guess = guess
        self._room = room_for(prepared.shape) if room is None else room
        self.common: PooledError | None = None
        self._expected: tuple[OutArgs, ExpectedNoise] | None = None
        self.retried = False
        self.had_lines = False
        self._take(_cleaned(image) if reference.cleaned else image)
        self.rounding = reference.rounding + rounding_variance(image)
        self.table = tap_table(reference.settings.interpolant)
        self.stated = self._kept()
        if np.isfinite(guess.sum()):  # as a rule
            self._places = self.stated.which, np.zeros((), np.bool_)
        else:
            known = np.isfinite(guess @ np.ones(guess.shape[1]))
            self._places = np.flatnonzero(self.stated.able & known), self.stated.able & ~known
        self._solve(*self._places)

    def _kept(self) -> Stated:
        """What the last picture was measured with, where its noise was stated the same."""
        reference = self.reference
        key, kept = (self.noise, reference.noise_model, reference.settings), reference.made_later
        found = kept.get("stated")  # another thread may measure with this reference
        if found is None or found[0] != key:
            found = kept["stated"] = key, self._as_stated()
        stated: Stated = found[1]
        return stated

    def _take(self, image: NDArray[Any]) -> None:
        """Measure in ``image``."""
        self.image = image
        self.common = None
        self.picture = self._picture(self.reference.reached(self.guess))

    def measure_in(self, image: NDArray[Any]) -> None:
        """Measure once more, in ``image``, from the same guess."""
        self._take(image)
        self._solve(*self._places)

    @property
    def is_disturbed(self) -> bool:
        """Whether the image leaves much more than its noise, or many ZOIs are refused: it may have wild pixels."""
        tried = len(self._places[0])
        refused = tried - np.count_nonzero(self.status == Status.OK)
        return bool(self.leaves_much or refused > DISTURBED_SHARE * tried)

    @property
    def leaves_much(self) -> bool:
        """Whether the image leaves much more than its noise."""
        return self.common is not None and self.common.usual > DISTURBED_RATIO

    def _solve(self, which: NDArray[np.intp], unknown: NDArray[np.bool_]) -> None:
        guess = self.guess
        if len(which) == len(guess):  # as a rule: no copies
            self.found, self.status = self.solved(which, guess)
            return
        self.found = OutArgs.unmeasured(*guess.shape)
        self.status = np.where(unknown, np.uint8(Status.LOST), self.reference.prepared.status)
        if len(which):
            self.keep(which, *self.solved(which, guess[which]))
        self.retried = False

    def _picture(self, box: Box) -> PictureArgs:
        from analysis.picture.prefilter import coefficients

        self._box, prepared = box, self.reference.prepared
        poles = prefilter_poles(self.reference.settings.interpolant)
        if not coefficients(self.image, np.float32(prepared.pattern.mean), poles, box, self._room):
            raise ValueError("the deformed image holds values that are not finite")
        return PictureArgs.within(self._room, prepared.shape, box, SPILL_PX)

    def _current_std(self) -> float:
        if self.noise is None:
            return self.reference.noise
        return float(np.sqrt(self.noise.variance(self.reference.prepared.pattern.mean)))

    def solved(self, which: NDArray[np.intp], guess: Floats) -> tuple[OutArgs, NDArray[np.uint8]]:
        """What comes of the B ZOIs ``which`` from their guesses (B, modes), and their status; kept by ``keep``."""
        reference = self.reference
        places: Places = which if len(which) < len(reference.index) else np.s_[:]
        found = self._fitted(places, guess)
        # A ZOI may have left the box alone, not the image.
        if self._box != reference.whole and (found.state == LEFT_IMAGE).any():
            self.picture = self._picture(reference.whole)
            found = self._fitted(places, guess)
        return found, self.verdicts(places, found)

    def _fitted(self, places: Places, guess: Floats) -> OutArgs:
        if self.reference.sensors is None:
            return self._iterated(places, guess)
        return self._by_phases(self.reference.sensors, places, guess)

    def keep(self, which: NDArray[np.intp], found: OutArgs, status: NDArray[np.uint8]) -> None:
        """Take over what was found of the ZOIs ``which``."""
        self.retried = self.retried or len(which) > 0
        self.status[which] = status
        self.found.put(which, found)

    def refuse_clipped(self, clipped: NDArray[np.bool_], among: NDArray[np.bool_] | None = None) -> None:
        """The status CLIPPED where too much of a ZOI lies on saturated pixels (H, W), found or as guessed.

        ``among`` (A,) are those to be checked; None: all.
        """
        from analysis.fit.assembly import clipped_share

        reference, grid = self.reference, self.reference.grid
        ok = self.status == Status.OK
        at = np.where(ok[:, None], self.found.p, self.guess)[:, [reference.modes // 2, 0]]
        seen = (reference.prepared.status == Status.OK) & np.isfinite(at).all(axis=1)
        which = np.flatnonzero(seen if among is None else seen & among)
        first = reference.prepared.origins[which] + np.rint(np.clip(at[which], -1e6, 1e6)).astype(np.int64)
        share = clipped_share(clipped, first, profile(reference.settings.window, grid.size))
        self.status[which[share > CLIPPED_SHARE]] = Status.CLIPPED

    def _iterated(self, which: Places, guess: Floats, max_iterations: int | None = None) -> OutArgs:
        from analysis.fit.iteration import track
        from analysis.fit.shared import share_warps

        out, stop, fit = OutArgs.starting(guess), self.stated.tolerance, self.stated.fit
        fit = fit._replace(which=fit.which[which])
        if max_iterations is not None:
            stop = stop.after(max_iterations)
        elif fit.order == 1 and 2 * len(guess) > len(self.guess):
            share_warps(self.picture, self.table, fit, stop, out, self.reference.tiles)
        todo = np.flatnonzero(out.state != CONVERGED)
        if 2 * len(todo) < len(guess):  # nothing of one is in the cache from the one before
            fit = fit._replace(spacing=fit.size)
        if len(todo):
            track(self.picture, self.table, fit, stop, out, todo)
        return out

    def _as_stated(self) -> Stated:
        from analysis.fit.sensitivity import parameter_scale

        reference, ready, grid = self.reference, self.reference.prepared, self.reference.grid
        order, every = reference.settings.order, np.arange(len(ready.origins))
        noise, current = self.variances(np.s_[:], np.tile(SAME_LIGHT, (len(every), 1)))
        both = noise + current
        fit = FitArgs(
            ready.images.ravel(), ready.images[0].size, ready.images.shape[2], every,
            ready.origins, grid.size, reference.spacing, order, ready.shapes.rows, ready.shapes.mix,
            ready.inverse, ready.cross, ready.weight * ready.energy, parameter_scale(order, grid.size), ready.bias,
            noise, np.maximum(ready.freedom * both, 1e-9),
        )  # fmt: skip
        known = ReferenceArgs(
            ready.signal, ready.freedom * reference.sharpness, reference.share_variance, reference.unit_sigma[2],
            reference.white, float(ready.shapes.noise[0]), min(1.0, (2 * grid.step / grid.size) ** 2),
            ready.information / np.maximum(noise, max(reference.rounding, 1e-9)),
            float(current.sum() / max(both.sum(), 1e-9)),
        )  # fmt: skip
        able = ready.status == Status.OK
        return Stated(reference.tolerance(self._current_std()), fit, known, able, np.flatnonzero(able))

    def _by_phases(self, sensors: Sensors, which: Places, guess: Floats) -> OutArgs:
        """The same by phases alone; one step of the spectral fit gives gain and residual."""
        from analysis.kernel.quadrature import iterate

        ready = self.reference.prepared
        values, state, iterations = iterate(
            sensors.weights[which], ready.images[3], ready.origins[which], self.picture, self.table,
            guess, self.stated.tolerance.at(which),
        )  # fmt: skip
        seen = self._iterated(which, values, max_iterations=1)
        return seen._replace(p=values, state=state, iterations=iterations)

    def verdicts(self, which: Places, found: OutArgs) -> NDArray[np.uint8]:
        """The status of some ZOIs with what was found of them."""
        from analysis.fit.verdict import judge

        reference, ready, settings = self.reference, self.reference.prepared, self.reference.settings
        known, noise = self.stated.known, self.expected(which, found.nuisance)
        expected = noise.felt
        if isinstance(which, slice):
            self._expected = found, noise
        far = CENTRE_VARIANCE[settings.order - 1]
        corner_steps = math.inf if settings.estimator == "phase" else CORNER_STEPS
        rule = VerdictArgs(
            self.is_given, ready.shapes.noise, reference.grid.size / 6, settings.bending_px, far, corner_steps
        )
        left = self._left(which, found)
        most = 2 * len(found.p) > len(self._places[0])  # some that are retried forgive nothing
        if self.common is None and most:
            self.common = self._pooled(which, found, left, expected, known)
        common = PooledError.none(len(known.signal)) if self.common is None else self.common
        status = np.empty(len(found.p), np.uint8)
        judge(found, left, expected, common.at(which), known.at(which), rule, status)
        return status

    def pooled(self, which: NDArray[np.intp]) -> PooledError | None:
        """What the fits of the ZOIs ``which``, as they are kept, leave in common."""
        found = self.found.at(which)
        expected = self.expected(which, found.nuisance).felt
        return self._pooled(which, found, self._left(which, found), expected, self.stated.known)

    def _pooled(
        self, which: Places, found: OutArgs, left: Floats, expected: Floats, known: ReferenceArgs
    ) -> PooledError | None:
        from analysis.fit.pooling import pooled

        places = np.arange(len(self.guess))[which]
        return pooled(found, left, expected, known, places, self.is_given)

    @property
    def noise_taken(self) -> Floats:
        """Variance a pixel of the reference, (A,), whose bias the fits have taken off (``noise_bias``), GL^2."""
        fit = self.stated.fit
        return np.asarray(fit.noise * np.minimum(np.maximum(self.found.left, 0) / fit.expected, 1))

    @property
    def is_given(self) -> bool:
        """Whether the noise of both images was given."""
        return self.noise is not None and self.reference.noise_model is not None

    def _left(self, which: Places, found: OutArgs) -> Floats:
        """Variance a pixel that the fit leaves, GL^2; rounding leaves something where the images are equal, too."""
        return np.maximum(found.left / self.reference.prepared.freedom[which], self.rounding)

    @property
    def expected_of_all(self) -> ExpectedNoise:
        """``expected`` of all ZOIs as they were found."""
        if self._expected is not None and self._expected[0] is self.found and not self.retried:
            return self._expected[1]
        return self.expected(np.s_[:], self.found.nuisance)

    def expected(self, which: Places, light: Floats) -> ExpectedNoise:
        """What noise alone makes of the difference of the images in ``light``, as in ``variances``."""
        from analysis.fit.assembly import ExpectedNoise, expect

        pattern, gain = self.reference.prepared.pattern, np.ascontiguousarray(light[:, 0])
        out = ExpectedNoise(np.empty(len(gain)), np.empty(len(gain)))
        kept = float(pattern.own_noise[0]), pattern.left_level
        expect(gain, kept, *self.variances(which, light), self.rounding, out)
        return out

    def variances(self, which: Places, light: Floats) -> tuple[Floats, Floats]:
        """Variance a pixel of the reference and of the image at some ZOIs, GL^2; the reference's where not known.

        ``light`` (B, >= 2) has the gain and the offset of the image: ``OutArgs.nuisance``.
        """
        level = self.reference.prepared.level[which]
        model, own = self.reference.noise_model, self.noise
        if model is None:
            reference = np.full(len(light), self.reference.noise**2)
        else:
            reference = model.variance(level)
        if own is None:
            return reference, reference
        if own.slope > 0:
            level = np.maximum(light[:, 0], 0) * level + self.constant_level(light)
        return reference, own.variance(level)

    def constant_level(self, light: Floats) -> Floats:
        """Grey level of the image where the reference is black, in ``light`` as in ``variances``, (B,), GL."""
        return np.asarray(light[:, 1] + (1 - light[:, 0]) * self.reference.prepared.pattern.mean)


def _cleaned(image: NDArray[Any]) -> NDArray[Any]:
    from analysis.picture.impulses import without_impulses

    cleaned = without_impulses(image)
    return image if cleaned is None else cleaned
