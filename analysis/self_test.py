"""The self-test of a machine: whether it computes and measures right what has a known result.

The linear algebra library solves problems whose results are whole numbers, and the kernel measures a pattern of known
motion and strain. A machine that is out of limits measures nothing; the message names its libraries.
"""

from __future__ import annotations

import importlib.metadata
import math
from collections.abc import Callable
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from acquire.errors import Spoken
from acquire.text import Message
from analysis.field import Roi, Status, StrainField, Window, ZoiGrid

MARGIN = 24
"""Pixels of the picture around the ZOIs."""
STEP = 8
"""Pixels from one of the 2 x 2 ZOIs to the next."""
LEVEL_GL, CONTRAST_GL = 2000.0, 400.0
WAVES = 24
MIN_FREQUENCY, MAX_FREQUENCY = 0.03, 0.12
"""Cycles per pixel of the waves of the pattern: what splines of degree 3 and 5 interpolate well."""
GOLDEN = math.pi * (3 - math.sqrt(5))
"""Turn from one wave to the next, so that the pattern has no direction."""
MIN_SIZE = 8
MAX_SIZE = {"spectral": 128, "phase": 64}
"""Sides of ZOIs, px. The estimator by phases needs much more time for large ones."""
NOISE_GL = {1: 6.0, 3: 0.07, 5: 0.0045}
"""Largest noise that is found in the pattern, which has none, by the degree of the spline, for ZOIs of ``USUAL`` px and
more. A machine that works shows up to half of it."""
USUAL = 30
GRADIENT = 0.005
"""Largest share by which a gradient of the reference, or sigma for a known noise, is off; a machine that works: 0.0001
of gradients, and of sigma at most 0.0012, of ZOIs of 8 px."""
ERROR_PX = {1: 0.25, 3: 0.005, 5: 0.0005}
"""Largest error of a displacement by the degree of the spline. A machine that works shows up to half of it with
degree 1, which interpolates badly, and a twentieth with degree 5, which tests use."""


class SelfTestCase(NamedTuple):
    """What of the settings the self-test depends on; ``size`` in px is that of a ZOI."""

    window: Window
    estimator: str
    order: int
    interpolant: int
    size: int

    @property
    def tested(self) -> SelfTestCase:
        """The one that stands for it. Loops are the same for all sizes, only the time is not."""
        return self._replace(size=min(max(self.size, MIN_SIZE), MAX_SIZE[self.estimator]))


Pixels = NDArray[np.float32]
Floats = NDArray[np.float64]
Measure = Callable[[Pixels, Pixels, ZoiGrid, SelfTestCase], tuple[StrainField, Pixels, float]]
"""Measures a deformed picture (the second) against a reference, with these settings; the gradients of the reference
that sigma comes from, along x and y, (2, H, W), GL/px; the share by which sigma is off a plain sum over pixels."""


class KnownMotion(NamedTuple):
    """Displacement u, v at the middle of the picture in px, and its gradients."""

    u: float
    v: float
    du_dx: float
    du_dy: float
    dv_dx: float
    dv_dy: float


STILL = KnownMotion(0, 0, 0, 0, 0, 0)
MOVED = KnownMotion(2.37, -1.61, 0.021, 0.008, -0.017, -0.013)
"""Over a ZOI of usual size the gradients lead through most places between two pixels."""


class Errors(NamedTuple):
    """The largest of any ZOI, of u and v in px and of the four gradients; NaN where ZOIs have no value.

    Of what sigma is made of: the share by which gradients of the picture, or sigma from them, are off, and the noise
    (GL) that is found.
    """

    length: float
    slope: float
    refused: int
    gradient: float
    noise: float


def limits(case: SelfTestCase) -> Errors:
    """What a machine may be off: a gradient by what moves the edge of a ZOI as far as ``ERROR_PX``."""
    length, noise = ERROR_PX[case.interpolant], NOISE_GL[case.interpolant] * min(1.0, case.size / USUAL)
    return Errors(length, length / (case.size / 2), 0, GRADIENT, noise)


def errors_of(measure: Measure, case: SelfTestCase) -> Errors:
    """How far off a known pattern is measured."""
    inside, side = case.size + STEP, case.size + STEP + 2 * MARGIN
    grid = ZoiGrid.cover(Roi(MARGIN, MARGIN, inside, inside), case.size, STEP)
    field, gradients, sigma_off = measure(picture(side, STILL), picture(side, MOVED), grid, case)
    middle = (side - 1) / 2
    x, y = np.meshgrid(grid.x - middle, grid.y - middle)
    length = np.stack([
        field.u - (MOVED.u + MOVED.du_dx * x + MOVED.du_dy * y),
        field.v - (MOVED.v + MOVED.dv_dx * x + MOVED.dv_dy * y),
    ])  # fmt: skip
    slope = [getattr(field, name) - getattr(MOVED, name) for name in KnownMotion._fields[2:]]
    refused = int(np.count_nonzero(field.status != Status.OK))
    off = [abs(_share(gradients[k], known) - 1) for k, known in enumerate(_gradients(side % 2))]
    worst = float(np.max([*off, sigma_off]))  # NaN where one is
    return Errors(float(np.abs(length).max()), float(np.abs(slope).max()), refused, worst, float(field.noise))


@lru_cache(maxsize=2)
def _gradients(odd: int) -> tuple[Floats, Floats]:
    """The gradients of the pattern in the middle along x and y, (16, 16) or where ``odd`` (17, 17), GL/px."""
    side, h = 16 + odd, 0.03
    moved = [(STILL._replace(u=-h), STILL._replace(u=h)), (STILL._replace(v=-h), STILL._replace(v=h))]
    x, y = ((picture(side, a).astype(float) - picture(side, b)) / (2 * h) for a, b in moved)
    return np.asarray(x, np.float64), np.asarray(y, np.float64)


def _share(found: Pixels, known: Floats) -> float:
    """The middle of ``found`` over what is known of it."""
    low = [(n - len(known)) // 2 for n in found.shape]
    part = found[low[0] : low[0] + len(known), low[1] : low[1] + len(known)]
    return float((part * known).sum() / (known * known).sum())


def picture(side: int, motion: KnownMotion) -> NDArray[np.float32]:
    """A sum of plane waves, seen after the motion, (side, side) float32, GL.

    The place that is seen at a pixel follows from the inverse of the motion in closed form, so nothing is
    interpolated; a plane wave is a product of one along x and one along y, so little is computed.
    """
    at = np.arange(side) - (side - 1) / 2
    a, b, c, d = 1 + motion.du_dx, motion.du_dy, motion.dv_dx, 1 + motion.dv_dy
    scale = 1 / (a * d - b * c)
    n = np.arange(WAVES)
    k = 2 * math.pi * (MIN_FREQUENCY + (MAX_FREQUENCY - MIN_FREQUENCY) * (n + 0.5) / WAVES)
    kx, ky = k * np.cos(GOLDEN * n), k * np.sin(GOLDEN * n)
    along_x, along_y = scale * (d * kx - c * ky), scale * (a * ky - b * kx)
    phase = 1.7 * n**2 - along_x * motion.u - along_y * motion.v
    columns = np.exp(1j * np.multiply.outer(along_x, at))
    rows = np.exp(1j * (np.multiply.outer(along_y, at) + phase[:, None]))
    # No matrix product: this must be right where the linear algebra is not.
    waves = np.einsum("ky,kx->yx", rows.real, columns.real) - np.einsum("ky,kx->yx", rows.imag, columns.imag)
    return np.asarray(LEVEL_GL + CONTRAST_GL * math.sqrt(2 / WAVES) * waves, np.float32)


TOLERANCE = 1e-6
"""Of results of the size of 1 to 10; a library that works is right to 1e-12."""
SIDE = 48
"""Of the matrices that are multiplied: more than the blocks that libraries cut them into."""


def algebra_fault() -> str:
    """The first function of numpy whose result is wrong, by name; empty where all are right."""
    for name, check in _CHECKS.items():
        try:
            if not check():
                return name
        except np.linalg.LinAlgError as error:
            return f"{name} ({error})"
    return ""


def _whole_numbers(*shape: int) -> NDArray[np.int64]:
    """Numbers from -8 to 8 without a pattern, always the same."""
    n = np.arange(np.prod(shape))
    return np.asarray((n * n * 7919 + n * 104729) % 1009 % 17 - 8).reshape(shape)


def _well_posed(*shape: int) -> Floats:
    """Square matrices with a diagonal that outweighs the rest."""
    return _whole_numbers(*shape) + 10.0 * shape[-1] * np.eye(shape[-1])


def _near(found: NDArray[Any], right: NDArray[Any]) -> bool:
    return found.shape == right.shape and bool(np.all(np.abs(found - right) <= TOLERANCE))


def _products() -> bool:
    """Sums of whole numbers are exact in every order; products of whole numbers need no library."""
    a, b = _whole_numbers(SIDE, SIDE + 3), _whole_numbers(SIDE + 3, SIDE + 5)
    right = a @ b
    kinds = (np.float32, np.float64, np.complex64, np.complex128)
    same = all(np.array_equal(a.astype(kind) @ b.astype(kind), right) for kind in kinds)
    return same and np.array_equal(a.astype(float) @ b[:, 0].astype(float), right[:, 0])


def _solve() -> bool:
    matrices, right = _well_posed(5, 6, 6), _whole_numbers(5, 6, 3)
    return _near(np.linalg.solve(matrices, np.einsum("bij,bjk->bik", matrices, right)), right)


def _inverse() -> bool:
    matrix = _well_posed(12, 12)
    return _near(np.einsum("ij,jk->ik", np.linalg.inv(matrix), matrix), np.eye(12))


def _least_squares() -> bool:
    columns, right = _well_posed(24, 24)[:, :6], _whole_numbers(6)
    return _near(np.linalg.lstsq(columns, np.einsum("ij,j->i", columns, right), rcond=None)[0], right)


def _polynomial() -> bool:
    x, right = np.linspace(-1, 1, 13), _whole_numbers(6)
    values = np.einsum("pi,p->i", x ** np.arange(6)[:, None], right)
    return _near(np.polynomial.polynomial.polyfit(x, values, 5), right) and _near(
        np.polyfit(x, values, 5)[::-1], right
    )


def _singular_values() -> bool:
    matrix = _well_posed(9, 9)
    left, values, right = np.linalg.svd(matrix)
    return _near(np.einsum("ij,j,jk->ik", left, values, right), matrix)


_CHECKS: dict[str, Callable[[], bool]] = {
    "a product of matrices": _products,
    "np.linalg.solve": _solve,
    "np.linalg.inv": _inverse,
    "np.linalg.lstsq": _least_squares,
    "np.polynomial.polynomial.polyfit": _polynomial,
    "np.linalg.svd": _singular_values,
}


class MachineError(Spoken, RuntimeError):
    """This machine computes wrong numbers: nothing may be measured on it."""


def check(measure: Measure, case: SelfTestCase) -> None:
    """Solve known problems and measure a known pattern, once a process and case; a few ms.

    What passed is not tested again; what failed is, and fails again.

    Raises
    ------
    MachineError
        Something is out of limits. The message names what, and the libraries.
    """
    _check_algebra()
    _check_measuring(measure, case.tested)


@lru_cache(maxsize=1)
def _check_algebra() -> None:
    wrong = algebra_fault()
    if wrong:
        raise MachineError("{fault} gives a wrong result on this machine; {advice}", wrong, _what_to_do())


@lru_cache(maxsize=256)
def _check_measuring(measure: Measure, case: SelfTestCase) -> None:
    wrong = measuring_fault(measure, case)
    if wrong:
        raise MachineError(
            "this machine does not measure a known pattern right (self-test with ZOIs of {size} px: {fault}); {advice}",
            case.size,
            wrong,
            _what_to_do(),
        )


def measuring_fault(measure: Measure, case: SelfTestCase) -> str:
    """What is wrong with the measuring of a known pattern; empty where nothing is."""
    try:
        with np.errstate(all="ignore"):  # whatever comes of a wrong library is looked at below
            found = errors_of(measure, case)
    except (ValueError, ArithmeticError, IndexError) as error:
        return f"{type(error).__name__}: {error}"
    allowed = limits(case)
    if found.refused:
        return Message("{n} of 4 ZOIs have no value", found.refused)
    if not (found.gradient <= allowed.gradient and found.noise <= allowed.noise):
        return Message(
            "what sigma is made of: gradients or their sums {gradient:.1%} off, limit {most_gradient:.1%},"
            " noise {noise:.2g} GL, limit {most_noise:.2g}",
            found.gradient,
            allowed.gradient,
            found.noise,
            allowed.noise,
        )
    if found.length <= allowed.length and found.slope <= allowed.slope:
        return ""
    return Message(
        "displacements {length:.4f} px off, limit {most_length:g},"
        " strains {slope:.0f} um/m off, limit {most_slope:.0f}",
        found.length,
        allowed.length,
        found.slope * 1e6,
        allowed.slope * 1e6,
    )


def _what_to_do() -> str:
    return Message(
        "nothing is measured with {libraries}; install other versions of these, or use another machine"
        " (under an emulator: another emulated processor)",
        libraries(),
    )


def libraries() -> str:
    """The libraries that results depend on and their versions, in words."""
    from analysis.compiled.vectors import PROCESSOR

    names = [f"numpy {np.__version__} ({_linear_algebra()})"]
    names += [f"{name} {importlib.metadata.version(name)}" for name in ("scipy", "numba", "llvmlite")]
    return f"{', '.join(names)} on the processor {PROCESSOR}"


def _linear_algebra() -> str:
    """BLAS and LAPACK as numpy was built with them."""
    built: dict[str, Any] = dict(np.show_config(mode="dicts"))
    parts = built.get("Build Dependencies", {})
    found = [parts.get(kind, {}) for kind in ("blas", "lapack")]
    names = dict.fromkeys(f"{one.get('name', 'unknown')} {one.get('version', '')}".strip() for one in found)
    return f"BLAS and LAPACK: {', '.join(names)}"
