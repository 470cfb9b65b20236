"""Exports of testing machines are read to the value, or refused with the option that settles it; none is read wrong."""

from __future__ import annotations

import io
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from acquire.errors import DataError
from live.config.sections import LoadConfig
from live.replay import export_text
from live.replay.export_file import Export, read_export
from tests.live.replay.exports import EXPORTS, TIMES, comma, thousands


def read(data: bytes | str, **options: Any) -> Export:
    data = data.encode() if isinstance(data, str) else data
    return read_export(io.BytesIO(data), "forces.csv", LoadConfig(**options))


@pytest.fixture(params=[1 << 20, 200], ids=["one block", "many blocks"])
def block(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> int:
    """Characters that are read at once."""
    monkeypatch.setattr(export_text, "_BLOCK", request.param)
    return int(request.param)


@pytest.mark.usefixtures("block")
@pytest.mark.parametrize("name", [name for name, made in EXPORTS.items() if not made.refused])
def test_exports_are_read_to_the_value(name: str) -> None:
    made = EXPORTS[name]
    found = read(made.data, **made.given)
    assert found.times is not None
    np.testing.assert_allclose(found.times - found.times[0], TIMES, atol=1e-6)
    np.testing.assert_allclose(found.forces, made.forces, rtol=max(made.tolerance, 1e-9), atol=1e-4)


@pytest.mark.usefixtures("block")
@pytest.mark.parametrize("name", [name for name, made in EXPORTS.items() if made.refused])
def test_what_has_two_readings_is_refused_with_its_option(name: str) -> None:
    made = EXPORTS[name]
    with pytest.raises(DataError, match=r"^forces\.csv: ") as refused:
        read(made.data, **made.given)
    assert made.refused in str(refused.value)
