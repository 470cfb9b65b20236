"""An error of the picture that is not noise as stated: what made it, and what it adds to the fits on average.

The cause shows in what is left of some ZOIs. Measured on twenty ways to spoil a real picture
(``tests/accuracy/degraded.py``): blocks 1.9 to 2.9 where a codec was, else 0.98 to 1.06; correlation of neighbours up
to 0.05 for noise, else 0.15 and more.

What white noise of the strength stated in the reference adds is taken off in the fit (``noise_bias``). Of what
compression or a filter leaves, neighbouring pixels are alike, and so the spectrum of what the fits leave takes the
place of the noise; how much of it is the reference's shows in what it has in common with the reference. Without it,
JPEG at quality 50 makes mean strains of 700 um/m too much, and a blur of 0.6 px, where there is none.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.field.uncertainty import Cause
from analysis.fit.validity import AGREES
from analysis.kernel.lines import inner, left_by_fit, lines_along, some, zois_of
from analysis.kernel.reference import ReferencePicture
from analysis.kernel.solve import Solution
from analysis.kernel.white_noise import halves
from analysis.picture.pattern import BLOCKS, blockiness

if TYPE_CHECKING:
    from analysis.fit.assembly import ExpectedNoise

Floats = NDArray[np.float64]
Pixels = NDArray[np.float32]
Places = NDArray[np.intp]

BLUR, SOME_BLUR, NEIGHBOURS = 0.25, 0.1, 0.12
"""Limits: growth of the variance of the blur that is the cause of an error, and that acts on u and v, px^2;
correlation of neighbouring pixels."""
SAMPLE, SPECTRA = 30, 150 * 32**2
"""ZOIs that are looked at, and pixels of those whose spectra are averaged."""
FEWEST, PART = 8, 8
"""ZOIs at least, and px of a square in them, in which a strain that varies is looked for."""
EXPLAINED, MIN_CORNER = 0.5, 0.01
"""Share of the error that shifts must explain; determinant of the gradients over its largest, from which on they are
known."""
BOTH_ALIKE = "compression"
"""Cause that spoils the reference as much as the picture. Its error goes with the pattern, which hides whose it is."""
MIN_PATTERN = 0.2
"""Share of the gradients of a reference that is pattern, at least."""
MIN_APART = 0.1
"""Share of the spectrum of the error that must be unlike that of the pattern to show which picture has the error."""


def error_cause(solution: Solution, ok: NDArray[np.bool_], left: Pixels) -> Cause:
    """What the error of the deformed picture looks like.

    ``ok`` (A,) are the ZOIs that have a value, and ``left`` (N, n, n) is what the fits leave of some of them.
    """
    if blockiness(solution.image) > BLOCKS:
        return "compression"
    left = left[:: max(1, len(left) // SAMPLE)]
    if lines_along(left) is not None:
        return "bands"
    if abs(float(np.median(solution.found.nuisance[ok, 2]))) > BLUR:
        return "blur"
    return "noise" if _is_white(left) else "filter"


def beside_strain(solution: Solution, ok: NDArray[np.bool_], expected: ExpectedNoise) -> float | None:
    """What the fits leave beside a strain that varies within the ZOIs, over what noise as stated leaves (variances).

    Such a strain shifts the pattern a little otherwise in each part of a ZOI. Where shifts of its parts explain most
    of what is left over the noise, and the rest is white, the picture has no other error. Of blocks, filters, blur
    and noise they explain next to nothing.

    Parameters
    ----------
    solution : Solution
    ok : (A,) bool
        ZOIs that have a value.
    expected : ExpectedNoise
        Of all ZOIs.

    Returns
    -------
    float or None
        None: it is an error of the picture.
    """
    size = solution.reference.grid.size
    which = some(ok, max(FEWEST, SAMPLE * 32**2 // size**2))
    left = _in_parts(left_by_fit(solution, which))
    noise = float(np.median(expected.felt[which]))
    excess = np.sum(left**2) - left.size * noise
    by_chance = 3 * noise * (2 * left.size) ** 0.5
    agrees = solution.is_given and AGREES[0] < 1 + excess / (left.size * noise) < AGREES[1]
    if (agrees or abs(excess) < by_chance) and _is_white(_joined(left)):
        return 1.0
    if excess < by_chance:
        return None
    ready = solution.reference.prepared
    dx, dy = (_in_parts(zois_of(ready.images[k], ready.origins[which], size)) for k in (0, 1))
    rest = left - _shifts(left, dx, dy)
    free = 2 * left[..., 0].size
    explained = np.sum(left**2) - np.sum(rest**2) - free * noise
    if explained < EXPLAINED * excess or not _is_white(_joined(rest)):
        return None
    return float(np.sum(rest**2) / (left.size - free) / noise)


def _shifts(left: Floats, dx: Floats, dy: Floats) -> Floats:
    """What of each part, (..., m), is a shift of the pattern with the gradients ``dx`` and ``dy``."""
    xx, yy, xy = (np.sum(a * b, axis=-1) for a, b in ((dx, dx), (dy, dy), (dx, dy)))
    x, y = (np.sum(d * left, axis=-1) for d in (dx, dy))
    determinant = xx * yy - xy**2
    clear = determinant > MIN_CORNER * xx * yy
    scale = np.where(clear, 1 / np.where(clear, determinant, 1), 0)
    u, v = scale * (yy * x - xy * y), scale * (xx * y - xy * x)
    return np.asarray(u[..., None] * dx + v[..., None] * dy)


def _in_parts(zois: NDArray[np.floating]) -> Floats:
    """Squares of ``PART`` px of ZOIs (N, n, n), (N, k, k, PART**2), from the middle."""
    count = zois.shape[1] // PART
    rim = (zois.shape[1] - count * PART) // 2
    inside = zois[:, rim : rim + count * PART, rim : rim + count * PART].astype(np.float64)
    parts = inside.reshape(len(zois), count, PART, count, PART).swapaxes(2, 3)
    return parts.reshape(len(zois), count, count, PART**2)


def _joined(parts: Floats) -> Floats:
    """The inverse of ``_in_parts``, (N, n, n)."""
    squares = parts.reshape(*parts.shape[:3], PART, PART).swapaxes(2, 3)
    return squares.reshape(len(parts), PART * parts.shape[1], -1)


def _is_white(left: NDArray[np.floating]) -> bool:
    within = inner(left)
    beside = (np.mean(within[:, 1:] * within[:, :-1]) + np.mean(within[:, :, 1:] * within[:, :, :-1])) / 2
    return bool(abs(beside) < NEIGHBOURS * np.mean(within**2))


class OwnError(NamedTuple):
    """What the error of a picture is in its reference, on average.

    Attributes
    ----------
    moments : (3,), GL^2
        A pixel's error times its own part in f, f_xx and f_yy.
    variance : float, GL^2
        Of white noise that would be as strong at the frequencies of J.
    attenuation : (2,)
        Share of J'J for u and for v that is pattern (regression dilution): by so much a fit answers less to an error.
    """

    moments: Floats
    variance: float
    attenuation: Floats


def coloured_bias(solution: Solution, own: OwnError) -> tuple[Floats, Floats]:
    """What to add to the parameters (A, modes) and to the growth of the variance of the blur (A,), px^2."""
    from analysis.fit.sensitivity import parameter_scale

    reference, ready, taken = solution.reference, solution.reference.prepared, solution.noise_taken[:, None]
    modes = reference.modes
    inverse = ready.weight * ready.inverse[:-1, :, [modes, -3, -2]]  # with the columns f, f_xx and f_yy
    white = ready.pattern.own_noise
    step = np.einsum("apk,ak->ap", inverse, own.moments - taken * white)
    step += (own.variance - taken) * (ready.bias - inverse @ white)  # of the gradients (``noise_bias``)
    step /= solution.found.nuisance[:, :1]
    moved = -parameter_scale(reference.settings.order, reference.grid.size) * step[:, :modes]
    return moved, step[:, -3] + step[:, -2]


def own_error(
    reference: ReferencePicture, which: Places, left: Pixels, cause: Cause, share: float
) -> OwnError:
    """The part of the error that is the reference's.

    The filter that makes f shows in the cross spectrum of f and the reference as it was recorded.

    Parameters
    ----------
    reference : ReferencePicture
    which, left : (N,), (N, n, n), GL
        Some ZOIs, and what the fits leave of them.
    cause : str
        Of the error.
    share : float
        Of the error of both pictures that is the reference's, as stated.
    """
    size = left.shape[1]
    window, often = _window(size), halves(size)
    of_left = _spectra(left, window)
    level, raw = _recorded(reference, which)
    power, recorded = (np.mean(np.abs(spectra) ** 2, axis=0) * often for spectra in (of_left, raw))
    shared, passed = (np.mean((of * raw.conj()).real, axis=0) * often for of in (-of_left, level))
    response = passed / recorded
    if cause != BOTH_ALIKE:
        share = _of_reference(power, shared, passed, often * passed / recorded**2, share)
    error = share * power * response
    bend = 2 - 2 * np.cos(2 * np.pi * np.fft.fftfreq(size))
    bends = np.ones((1, 1)), bend[None, : error.shape[1]], bend[:, None]
    errors, patterns, squares = (
        np.array([np.sum(of * b) for b in bends]) for of in (error, passed, passed * response)
    )
    weight = passed * response * (bends[1] + bends[2])
    scale = np.sum(window**2)
    return OwnError(
        errors * (1, -1, -1) / (scale * size**2),
        share * float(np.sum(power / often * weight) / np.sum(weight) / scale),
        np.clip((patterns - errors)[1:] / squares[1:], MIN_PATTERN, 1),
    )


def _of_reference(power: Floats, shared: Floats, passed: Floats, weight: Floats, stated: float) -> float:
    """What share of an error with the spectrum ``power`` is the reference's; ``stated`` where that does not show.

    The difference of the pictures has the error of the reference with the opposite sign. So what is left and the
    reference share that error in their spectrum, ``shared``, with the sign changed, and as much of the pattern,
    ``passed``, as the gain is too small. Least squares part the two.
    """
    weight = weight / power
    products = np.array([[np.sum(weight * a * b) for b in (power, passed, shared)] for a in (power, passed)])
    (error, both, seen), (_, gain, seen_gain) = products
    determinant = error * gain - both**2
    if not determinant > MIN_APART * error * gain:
        return stated
    return float(np.clip((gain * seen - both * seen_gain) / determinant, 0, 1))


def _recorded(reference: ReferencePicture, which: Places) -> NDArray[np.complex64]:
    """Spectra of some ZOIs of the filtered pattern and of the reference as it was recorded, (2, N, n, n // 2 + 1).

    The last ones are remembered: as a rule these ZOIs are the same in every picture.
    """
    ready, kept, key = reference.prepared, reference.kept, which.tobytes()
    found = kept.get(key)  # another thread may measure with this reference
    if found is None:
        size, at = reference.grid.size, ready.origins[which]
        found = np.stack([_spectra(zois_of(ready.images[k], at, size), _window(size)) for k in (2, 3)])
        kept.clear()
        kept[key] = found
    return found


def left_of_some(solution: Solution, ok: NDArray[np.bool_]) -> tuple[Places, Pixels]:
    """As many of the ZOIs ``ok`` (A,) as spectra need, (N,), and what the fits leave of them, (N, n, n)."""
    which = some(ok, SPECTRA // solution.reference.grid.size**2)
    return which, left_by_fit(solution, which)


def by_frequency(reference: ReferencePicture, left: Pixels) -> Floats:
    """Variance of u, its gradients, v and its over that which the shapes of third degree have by the same error, (6,).

    By the spectrum of what the fits leave of some ZOIs, (N, n, n).
    """
    window = _window(reference.grid.size)
    power = np.mean(np.abs(_spectra(_without_planes(left), window)) ** 2, axis=0)
    seen = np.sum(reference.response * power, axis=(1, 2))
    return np.asarray(seen[:6] / seen[6:].repeat(3))


def _without_planes(left: Pixels) -> Pixels:
    """ZOIs (N, n, n) without level and slopes, which the fit takes for light."""
    x = np.arange(left.shape[1]) - (left.shape[1] - 1) / 2
    along_x, along_y = (np.einsum(f"nij,{k}->n", left, x) / (len(x) * np.sum(x**2)) for k in "ji")
    planes = along_x[:, None, None] * x + along_y[:, None, None] * x[:, None]
    return np.asarray(left - left.mean(axis=(1, 2), keepdims=True) - planes, np.float32)


def _window(size: int) -> Floats:
    """That of Hann without its zeros, (n, n)."""
    line = np.hanning(size + 2)[1:-1]
    return np.outer(line, line)


def _spectra(zois: Pixels, window: Floats) -> NDArray[np.complex64]:
    """Of ZOIs (N, n, n) without their means, under a window: the half with columns from 0, (N, n, n // 2 + 1)."""
    from scipy.fft import rfft2

    return np.asarray(rfft2((zois - zois.mean(axis=(1, 2), keepdims=True)) * window.astype(np.float32)))
