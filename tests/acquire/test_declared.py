"""What a dataset must be: types, shapes and ranges, one by one."""

from __future__ import annotations

import math

import h5py
import numpy as np
import pytest

from acquire.hdf5.declared import Declared

TEXT = h5py.string_dtype()


@pytest.mark.parametrize(
    ("declared", "taken", "refused"),
    [
        ("S", ["S8"], [TEXT, "u1", "f8"]),
        ("text", ["S8", TEXT], ["u1", "f8", "O"]),
        ("int", ["u1", "i8"], ["f8", ">i4", "S8"]),
        ("number", ["u1", "i8", "f4"], [">f4", "S8", "?"]),
        ("f8", ["f8"], ["f4", "i8", [("a", "f8")]]),
    ],
)
def test_types(declared: str, taken: list[object], refused: list[object]) -> None:
    what = Declared(declared)
    assert all(what.takes_type(np.dtype(kind)) for kind in taken)  # type: ignore[call-overload]
    assert not any(what.takes_type(np.dtype(kind)) for kind in refused)  # type: ignore[call-overload]


def test_shapes() -> None:
    rows = Declared("f8", (None, 3))
    assert rows.takes_shape((0, 3)) and rows.takes_shape((7, 3))
    assert not any(rows.takes_shape(shape) for shape in (None, (3,), (7, 2), (7, 3, 1)))


def test_the_ends_of_a_range_belong_to_it_and_not_a_number_does_not() -> None:
    share = Declared("f8", low=0.0, high=1.0)
    assert share.outside(np.array([-0.1, 0.0, 0.5, 1.0, 1.1])).tolist() == [True, False, False, False, True]
    assert share.takes_value(0.0) and share.takes_value(1.0)
    assert not share.takes_value(1.1) and not share.takes_value(math.nan)
