"""Errors that ZOIs or pictures have in common, by value: sums, parts, and which part of sigma they are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from analysis import Roi, StrainField, ZoiGrid
from analysis.field.common import CommonError
from analysis.field.picture_error import PictureError

GRID = ZoiGrid.cover(Roi(0, 0, 96, 64), 32, 16)
RNG = np.random.default_rng(4)


def error(count: int) -> CommonError:
    half = RNG.normal(0, 1, (count, count))
    return CommonError(RNG.normal(0, 1, (count, 6, *GRID.shape)), half @ half.T)


def test_two_errors_beside_each_other_add_their_variances() -> None:
    one, other = error(2), error(3)
    both = one.beside(other)
    for name in ("u", "dv_dy", "exy"):
        assert both.variance(name) == pytest.approx(one.variance(name) + other.variance(name))
    weights = RNG.normal(0, 1, (6, *GRID.shape))
    assert both.variance_of_sum(weights) == pytest.approx(
        one.variance_of_sum(weights) + other.variance_of_sum(weights)
    )
    assert one.beside(None) is one


def test_a_part_has_the_error_of_its_rows_and_columns() -> None:
    whole = error(2)
    part = whole.part(slice(0, 2), slice(1, 4))
    assert np.array_equal(part.variance("exx"), whole.variance("exx")[0:2, 1:4])


def test_a_common_error_is_no_part_of_that_of_the_reference() -> None:
    field = StrainField.from_values(GRID, {"u": 1.0}, 1e-3)
    more = replace(field, common=error(1))
    assert np.array_equal(more.sigma("u", "reference"), field.sigma("u", "reference"))
    variance = np.asarray(more.common.variance("u")) if more.common is not None else np.zeros(GRID.shape)
    assert more.sigma("u") ** 2 == pytest.approx(field.sigma("u") ** 2 + variance)


@pytest.mark.parametrize("colour", [(4.0, 1.0), (1.0, 4.0)])
def test_the_factor_of_a_picture_is_that_of_the_worse_of_u_and_v(colour: tuple[float, float]) -> None:
    assert PictureError(1.5, colour).factor == pytest.approx(3.0)
