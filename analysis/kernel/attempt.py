"""The measuring of one image against a reference: iterate from a guess and judge.

``rescue`` tries again what was lost, ``result`` puts everything on the grid.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.field import Status
from analysis.fit.bundles import Fit, Known, Out, Picture, Rule
from analysis.kernel.noise import NoiseModel
from analysis.kernel.quadrature import Sensors
from analysis.kernel.reference import SPILL_PX, Reference
from analysis.picture import prefilter_taps, tap_table

Floats = NDArray[np.float64]
Places = NDArray[np.intp] | slice
"""Which of the active ZOIs."""


class Attempt:
    """Parameters and verdict of every active ZOI of one image, as they come.

    Parameters
    ----------
    reference : Reference
    image : (H, W) uint8, uint16 or float32, GL
    noise : NoiseModel or None
        Of the image; None: not known.
    guess : (A, modes)
        Every ZOI that has a pattern and a guess is measured; one without a guess is LOST.

    Attributes
    ----------
    found : Out
        What the iteration says of all A ZOIs; NaN where there was none.
    status : (A,) uint8
    tolerance : Stop
        Where the iteration may stop.
    """

    def __init__(
        self, reference: Reference, image: NDArray[Any], noise: NoiseModel | None, guess: Floats
    ) -> None:
        from analysis.picture.prefilter import coefficients

        prepared, degree = reference.prepared, reference.settings.interpolant
        self.reference = reference
        self.image = image
        self.noise = noise
        self.guess = guess
        height, width = prepared.shape
        flat = coefficients(image, np.float32(prepared.pattern.mean), prefilter_taps(degree))
        self.picture = Picture(flat, width, height, SPILL_PX)
        self.table = tap_table(degree)
        self.tolerance = reference.tolerance(self._current_std())
        able = prepared.status == Status.OK
        known = np.isfinite(guess.sum()) or np.isfinite(guess @ np.ones(guess.shape[1]))  # as a rule all
        which = np.flatnonzero(able & known)
        if len(which) == len(guess):  # as a rule: no copies
            self.found, self.status = self.tried(which, guess)
            return
        self.found = Out.nothing(*guess.shape)
        self.status = np.where(able & ~known, np.uint8(Status.LOST), prepared.status)
        if len(which):
            self.keep(which, *self.tried(which, guess[which]))

    def _current_std(self) -> float:
        if self.noise is None:
            return self.reference.noise
        return float(np.sqrt(self.noise.variance(self.reference.prepared.pattern.mean)))

    def tried(self, which: NDArray[np.intp], guess: Floats) -> tuple[Out, NDArray[np.uint8]]:
        """What comes of the B ZOIs ``which`` from their guesses (B, modes), and their status; kept by ``keep``."""
        reference = self.reference
        places: Places = which if len(which) < len(reference.index) else np.s_[:]
        if reference.sensors is None:
            found = self._iterated(places, guess)
        else:
            found = self._by_phases(reference.sensors, places, guess)
        return found, self._judged(places, found)

    def keep(self, which: NDArray[np.intp], found: Out, status: NDArray[np.uint8]) -> None:
        """Take over what was found of the ZOIs ``which``."""
        self.status[which] = status
        self.found.put(which, found)

    def _iterated(self, which: Places, guess: Floats, max_iterations: int | None = None) -> Out:
        from analysis.fit.iteration import track

        out, stop = Out.starting(guess), self.tolerance.at(which)
        if max_iterations is not None:
            stop = stop.after(max_iterations)
        track(self.picture, self.table, self._fit(which), stop, out)
        return out

    def _fit(self, which: Places) -> Fit:
        from analysis.fit.sensitivity import parameter_scale

        ready, grid, order = self.reference.prepared, self.reference.grid, self.reference.settings.order
        padded = which if isinstance(which, slice) else np.append(which, -1)
        return Fit(
            ready.images.ravel(), ready.images[0].size, ready.images.shape[2],
            ready.origins[which], grid.size, grid.step, order, ready.shapes.rows, ready.shapes.mix,
            ready.inverse[padded], ready.cross[padded],
            ready.weight * ready.energy[which], parameter_scale(order, grid.size),
        )  # fmt: skip

    def _by_phases(self, sensors: Sensors, which: Places, guess: Floats) -> Out:
        """The same by phases alone; one step of the spectral fit tells gain and residual."""
        from analysis.kernel.quadrature import iterate

        ready = self.reference.prepared
        values, state, iterations = iterate(
            sensors.weights[which], ready.images[3], ready.origins[which], self.picture, self.table,
            guess, self.tolerance.at(which),
        )  # fmt: skip
        seen = self._iterated(which, values, max_iterations=1)
        return Out(values, seen.left, seen.bending, seen.nuisance, state, iterations)

    def _judged(self, which: Places, found: Out) -> NDArray[np.uint8]:
        from analysis.fit.verdict import judge

        reference, ready = self.reference, self.reference.prepared
        freedom = ready.freedom[which]
        known = Known(ready.signal[which], freedom * reference.sharpness, reference.share_variance[which])
        noise_known = self.noise is not None and reference.noise_model is not None
        rule = Rule(noise_known, ready.shapes.noise, reference.grid.size / 6, reference.settings.bending_px)
        status = np.empty(len(freedom), np.uint8)
        judge(found, found.left / freedom, self._expected(which, found.nuisance[:, 0]), known, rule, status)
        return status

    def _expected(self, which: Places, gain: Floats) -> Floats:
        """Variance a pixel that noise alone leaves in the difference of the images, GL^2."""
        reference, current = self.variances(which, gain)
        return np.asarray(np.minimum(gain**2, 25.0) * reference + current)

    def variances(self, which: Places, gain: Floats) -> tuple[Floats, Floats]:
        """Variance a pixel of the reference and of the image at some ZOIs, GL^2; the reference's where not known."""
        level = self.reference.prepared.level[which]
        model, own = self.reference.noise_model, self.noise
        if model is None:
            reference = np.full(len(gain), self.reference.noise**2)
        else:
            reference = model.variance(level)
        if own is None:
            return reference, reference
        return reference, own.variance(level if own.slope == 0 else level * np.maximum(gain, 0))
