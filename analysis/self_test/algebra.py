"""Whether the linear algebra library computes what has a known result in whole numbers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
TOLERANCE = 1e-6
"""Of results of the size of 1 to 10; a library that works is right to 1e-12."""
SIDE = 48
"""Of the matrices that are multiplied: more than the blocks that libraries cut them into."""


def wrong_algebra() -> str:
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
