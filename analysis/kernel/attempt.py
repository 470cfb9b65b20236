"""The measuring of one image: iterate, judge, rescue, and put everything on the grid.

The other half of ``PhaseKernel``, which holds what does not change from frame to frame.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from analysis.field import Motion, Status, StrainField, profile
from analysis.fit.validity import CLIPPED_SHARE
from analysis.follow.renewal import UNSHARED
from analysis.kernel.images import clipped_share
from analysis.kernel.noise import NoiseModel
from analysis.picture import prefilter_taps, tap_table

if TYPE_CHECKING:
    from analysis.kernel.phase_kernel import PhaseKernel

Floats = NDArray[np.float64]
Places = NDArray[np.intp] | slice
"""Which of the active ZOIs."""

RESCUE_ROUNDS = 40
SEARCH_SHARE = 0.3
"""Share of lost ZOIs from which on the whole picture is searched again."""
_WORTH_RETRYING = np.isin(
    list(Status), (Status.LOST, Status.NOT_CONVERGED, Status.POOR_MATCH, Status.OUTSIDE)
)
"""By status."""


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """What the iteration says of B ZOIs.

    Attributes
    ----------
    values : (B, modes)
    left, bending : (B,)
        Weighted sum of squares that the fit leaves, GL^2; what it leaves of a displacement that
        bends or jumps inside the ZOI, px^2 (``shapes.bent``).
    nuisance : (B, 2)
        Gain, and offset in GL.
    state, iterations : (B,) uint8
    """

    values: Floats
    left: Floats
    bending: Floats
    nuisance: Floats
    state: NDArray[np.uint8]
    iterations: NDArray[np.uint8]


class Attempt:
    """The measuring of one image: parameters and verdict of every active ZOI, as they come."""

    # As in Outcome, of all ZOIs; there once ``run`` was called.
    p: Floats
    left: Floats
    nuisance: Floats
    iterations: NDArray[np.uint8]
    _guess: Floats

    def __init__(self, kernel: PhaseKernel, image: NDArray[Any], noise: NoiseModel | None) -> None:
        from analysis.picture.prefilter import coefficients

        self.kernel = kernel
        self.image = image
        self.noise = noise
        self.ready = kernel._prepared
        degree = kernel.settings.interpolant
        offset = np.float32(self.ready.pattern.mean)
        self.coefficients = coefficients(image, offset, prefilter_taps(degree))
        self.status = self.ready.status.copy()
        self.tolerance, self.trust = kernel._tolerance(self._current_std())

    def _current_std(self) -> float:
        if self.noise is None:
            return self.kernel.reference_noise
        return float(np.sqrt(self.noise.variance(self.ready.pattern.mean)))

    def run(self, guess: Floats) -> None:
        """Measure every ZOI that has a pattern and a guess; the others are LOST."""
        self._guess = guess
        able = self.ready.status == Status.OK
        known = np.isfinite(guess.sum()) or np.isfinite(guess @ np.ones(guess.shape[1]))  # as a rule all
        self.status[able & ~known] = Status.LOST
        which = np.flatnonzero(able & known)
        if len(which) < len(guess):
            self.p = np.full(guess.shape, np.nan)
            self.left = np.full(len(guess), np.nan)
            self.nuisance = np.full((len(guess), 2), np.nan)
            self.iterations = np.zeros(len(guess), np.uint8)
        self._track(which, guess)

    def _track(self, which: NDArray[np.intp], guess: Floats) -> None:
        """Iterate the ZOIs ``which`` from their guesses and keep what comes out."""
        if len(which) == 0:
            return
        places: Places = which if len(which) < len(guess) else np.s_[:]  # as a rule all: no copies
        from analysis.fit.verdict import judge

        iterate = self._iterate if self.kernel._sensors is None else self._iterate_phases
        found = iterate(places, guess[places])
        ready, kernel = self.ready, self.kernel
        if len(which) == len(guess):
            self.p, self.left, self.nuisance = found.values, found.left, found.nuisance
            self.iterations = found.iterations
        else:
            self.p[which], self.left[which], self.nuisance[which] = found.values, found.left, found.nuisance
            self.iterations[which] = found.iterations
        gain, freedom = found.nuisance[:, 0], ready.freedom[places]
        status = np.empty(len(which), np.uint8)
        judge(
            found.state, found.left / freedom, self._expected(places, gain), ready.signal[places], gain,
            freedom * kernel._sharpness, self.noise is not None and kernel._noise is not None,
            found.bending, kernel._share_variance[places], ready.shapes.noise, found.values,
            kernel.grid.size / 6, kernel.settings.bending_px, status,
        )  # fmt: skip
        self.status[places] = status

    def _iterate_phases(self, which: Places, guess: Floats) -> Outcome:
        """The same by phases alone; one step of the spectral fit tells gain and residual."""
        from analysis.kernel.quadrature import iterate

        sensors, settings = self.kernel._sensors, self.kernel.settings
        assert sensors is not None
        values, state, iterations = iterate(
            sensors.weights[which], self.ready, self.ready.origins[which], self.kernel.grid.size, self.coefficients,
            guess, self.tolerance[which], settings, self.kernel._over,
        )  # fmt: skip
        judged = self._iterate(which, values, max_iterations=1)
        return replace(judged, values=values, state=state, iterations=iterations)

    def _iterate(self, which: Places, guess: Floats, max_iterations: int | None = None) -> Outcome:
        from analysis.fit.iteration import track
        from analysis.fit.sensitivity import parameter_scale

        ready, kernel, settings = self.ready, self.kernel, self.kernel.settings
        size, count = kernel.grid.size, len(guess)
        height, width = ready.shape
        padded = which if isinstance(which, slice) else np.append(which, -1)
        out = Outcome(
            guess.copy(), np.empty(count), np.empty(count), np.empty((count, 2)),
            np.empty(count, np.uint8), np.empty(count, np.uint8),
        )  # fmt: skip
        track(
            self.coefficients, width, height, ready.images.ravel(), ready.images[0].size, ready.images.shape[2],
            ready.origins[which], size, kernel.grid.step, settings.order, ready.shapes.rows, ready.shapes.mix,
            ready.inverse[padded], ready.cross[padded],
            ready.weight * ready.energy[which], parameter_scale(settings.order, size),
            self.tolerance[which], self.trust[which], tap_table(settings.interpolant),
            kernel._over, max_iterations or settings.max_iterations,
            out.values, out.left, out.bending, out.nuisance, out.state, out.iterations,
        )  # fmt: skip
        return out

    def _expected(self, which: Places, gain: Floats) -> Floats:
        """Variance a pixel that noise alone leaves in the difference of the images, GL^2."""
        reference, current = self._variances(which, gain)
        return np.asarray(np.minimum(gain**2, 25.0) * reference + current)

    def _variances(self, which: Places, gain: Floats) -> tuple[Floats, Floats]:
        level = self.ready.level[which]
        model, own = self.kernel._noise, self.noise
        if model is None:
            reference = np.full(len(gain), self.kernel.reference_noise**2)
        else:
            reference = model.variance(level)
        if own is None:
            return reference, reference
        return reference, own.variance(level if own.slope == 0 else level * np.maximum(gain, 0))

    def rescue(self, before: Floats | None) -> None:
        """Try lost ZOIs again: without extrapolation, from neighbours, and by a search."""
        if not self._lost().any():
            return
        # Without its gradients a guess is right for ZOIs beside a discontinuity.
        displacements = np.arange(self.kernel._modes) % (self.kernel._modes // 2) == 0
        self._retry(self._guess * displacements if before is None else before)
        self._from_neighbours()
        able = np.count_nonzero(self.ready.status == Status.OK)
        if before is not None and np.count_nonzero(self._lost()) > SEARCH_SHARE * able:
            self._retry(self.kernel._searched(self.image))
            self._from_neighbours()

    def _lost(self) -> NDArray[np.bool_]:
        return np.asarray(_WORTH_RETRYING[self.status] & (self.ready.status == Status.OK))

    def _retry(self, guess: Floats) -> None:
        """Track lost ZOIs from another guess; a worse outcome does not replace a better one."""
        which = np.flatnonzero(self._lost() & np.isfinite(guess).all(axis=1))
        kept = [a[which].copy() for a in self._found()]
        self._track(which, guess)
        worse = self.status[which] != Status.OK
        for array, old in zip(self._found(), kept, strict=True):
            array[which[worse]] = old[worse]

    def _found(self) -> tuple[NDArray[Any], ...]:
        return self.p, self.left, self.nuisance, self.iterations, self.status

    def _from_neighbours(self) -> None:
        """Let good ZOIs lend their shape to lost neighbours, round by round."""
        tried = np.zeros(self.kernel.grid.shape, np.uint8)
        for _ in range(RESCUE_ROUNDS):
            guess, lenders = self._lent()
            fresh = np.isfinite(guess[:, 0]) & self._lost() & (lenders > tried.ravel()[self.kernel._index])
            if not fresh.any():
                return
            tried.ravel()[self.kernel._index] = lenders
            self._retry(np.where(fresh[:, None], guess, np.nan))

    def _lent(self) -> tuple[Floats, NDArray[np.uint8]]:
        """For each ZOI the mean of what its good neighbours predict there, and their number."""
        kernel, grid = self.kernel, self.kernel.grid
        rows, columns = grid.shape
        half = kernel._modes // 2
        good = self.status == Status.OK
        shape = np.zeros((6, rows * columns))
        affine = [0, 1, 2, half, half + 1, half + 2]
        shape[:, kernel._index[good]] = kernel._total(self.p)[good][:, affine].T
        valid = np.zeros(rows * columns)
        valid[kernel._index[good]] = 1
        total, number = np.zeros((6, rows, columns)), np.zeros((rows, columns))
        padded = np.pad(shape.reshape(6, rows, columns), ((0, 0), (1, 1), (1, 1)))
        there = np.pad(valid.reshape(rows, columns), 1)
        for dy in (-1, 0, 1):
            for dx in (-1, 0, 1):
                part = padded[:, 1 + dy : 1 + dy + rows, 1 + dx : 1 + dx + columns].copy()
                for r in (0, 3):
                    part[r] -= grid.step * (dx * part[r + 1] + dy * part[r + 2])
                weight = there[1 + dy : 1 + dy + rows, 1 + dx : 1 + dx + columns]
                total += part * weight
                number += weight
        with np.errstate(invalid="ignore"):
            mean = np.where(number > 0, total / np.maximum(number, 1), np.nan)
        guess = np.zeros((len(kernel._index), kernel._modes))
        guess[:, affine] = mean.reshape(6, -1)[:, kernel._index].T
        return kernel._local(guess), number.ravel()[kernel._index].astype(np.uint8)

    def field(
        self, predicted: Floats | None, carried: Motion, clipped: NDArray[np.bool_] | None
    ) -> StrainField:
        """Put everything on the grid; ``predicted`` are the parameters that were expected, (A, modes)."""
        from analysis.fit.assembly import weigh
        from analysis.follow.prediction import motion_after

        if clipped is not None:
            self._reject_clipped(clipped)
        kernel = self.kernel
        ok = self.status == Status.OK
        gain = self.nuisance[:, 0]
        reference, current = self._noise_parts(ok)
        residual, first, whole = np.empty((3, len(ok)), np.float32)
        weigh(ok, self.left, self.ready.freedom, gain, reference, current, residual, first, whole)
        covariance_reference, covariance = self._covariances(ok, reference, current, first, whole)
        values = kernel._total(self.p)
        if not ok.all():
            values = np.where(ok[:, None], values, np.nan)
        status = np.full(len(kernel.grid.active.ravel()), Status.NOT_MEASURED, np.uint8)
        status[kernel._index] = self.status
        return StrainField(
            grid=kernel.grid,
            parameters=self._spread(values),
            covariance=covariance,
            covariance_reference=covariance_reference,
            residual=self._spread(residual[:, None])[0],
            status=status.reshape(kernel.grid.shape),
            iterations=self._spread(self.iterations[:, None], 0)[0],
            gain=self._spread(gain[:, None].astype(np.float32))[0],
            noise=self._noise_found(ok, current),
            window=kernel.settings.window,
            motion=None
            if predicted is None
            else motion_after(carried, values, predicted, self.trust, kernel.grid.size / 6),
        )

    def _noise_found(self, ok: NDArray[np.bool_], current: Floats) -> float:
        """Standard deviation of the deformed image, GL, as given or found; the median over the ZOIs."""
        if self.noise is not None and self.noise.slope == 0 and ok.any():
            return float(np.sqrt(self.noise.floor))
        return float(np.sqrt(np.median(current[ok]))) if ok.any() else float("nan")

    def _spread(self, values: NDArray[Any], empty: float = np.nan) -> NDArray[Any]:
        """(A, K) onto the grid: (K, R, C); where all ZOIs are active, the same memory."""
        rows, columns = self.kernel.grid.shape
        if len(self.kernel._index) == rows * columns:
            return values.T.reshape(-1, rows, columns)
        out = np.full((values.shape[1], rows * columns), empty, values.dtype)
        out[:, self.kernel._index] = values.T
        return out.reshape(-1, rows, columns)

    def _reject_clipped(self, clipped: NDArray[np.bool_]) -> None:
        good = np.flatnonzero(self.status == Status.OK)
        half = self.kernel._modes // 2
        shift = np.rint(self.p[good][:, [half, 0]]).astype(np.int64)
        line = profile(self.kernel.settings.window, self.kernel.grid.size)
        share = clipped_share(clipped, self.ready.origins[good] + shift, line)
        self.status[good[share > CLIPPED_SHARE]] = Status.CLIPPED

    def _noise_parts(self, ok: NDArray[np.bool_]) -> tuple[Floats, Floats]:
        """Variances a pixel of the two images at each ZOI, (A,), GL^2; what is not given, from the residual."""
        reference, current = self._variances(np.s_[:], self.nuisance[:, 0])
        if self.noise is not None or not ok.any():
            return reference, current
        pooled = float(np.median((self.left / self.ready.freedom)[ok]))
        if self.kernel._noise is None:  # shared equally
            return np.full(len(ok), pooled / 2), np.full(len(ok), pooled / 2)
        rest = max(pooled - float(np.median(reference)), pooled / 4)
        return reference, np.full(len(ok), rest)

    def _covariances(
        self,
        ok: NDArray[np.bool_],
        reference: Floats,
        current: Floats,
        first: NDArray[np.float32],
        whole: NDArray[np.float32],
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Covariance that the reference causes, and the whole, (21, R, C), NaN where there is no value.

        ``first`` and ``whole`` (A,) are what scales the unit covariances (``assembly.weigh``).
        """
        from analysis.fit.assembly import LEAST_GAIN, scale

        kernel, model = self.kernel, self.kernel._noise
        grows = any(m is not None and m.slope > 0 for m in (model, self.noise))
        if kernel._placement is None and not (grows and self.ready.covariance_level is not None):
            unit = kernel._unit
            out = np.empty((2, *unit.shape), np.float32)
            flat = out.reshape(2, len(unit), -1)
            scale(
                unit.reshape(len(unit), -1), self._spread(first[:, None]).ravel(),
                self._spread(whole[:, None]).ravel(), flat[0], flat[1],
            )  # fmt: skip
            return out[0], out[1]
        own = 1 / np.maximum(self.nuisance[:, 0], LEAST_GAIN) ** 2
        from_reference, from_current = self._level_covariances(reference, current, own)
        placement = kernel._placement
        if placement is not None:
            from_current = placement.spread(self.p, from_current)
            # The noise of a renewed picture enters twice with opposite sign and nearly cancels.
            renewed = np.float32(UNSHARED) * placement.spread(self.p, from_reference)
            from_reference = placement.carried(self.p) + renewed
        invalid = np.where(ok, np.float32(0), np.float32(np.nan))[:, None]
        return (
            self._spread(from_reference + invalid),
            self._spread(from_reference + from_current + invalid),
        )

    def _level_covariances(
        self, reference: Floats, current: Floats, own: Floats
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """The two parts (A, 21) with noise that grows with the grey level inside each ZOI."""
        ready, model = self.ready, self.kernel._noise
        unit, slope = ready.covariance, ready.covariance_level
        gain, offset = self.nuisance[:, 0], self.nuisance[:, 1]
        first = reference[:, None] * unit
        second = (current * own)[:, None] * unit
        if slope is not None and model is not None and model.slope > 0:
            first = model.floor * unit + model.slope * slope
        if slope is not None and self.noise is not None and self.noise.slope > 0:
            constant = self.noise.floor + self.noise.slope * (offset + (1 - gain) * ready.pattern.mean)
            second = own[:, None] * (constant[:, None] * unit + (self.noise.slope * gain)[:, None] * slope)
        return first.astype(np.float32), second.astype(np.float32)
