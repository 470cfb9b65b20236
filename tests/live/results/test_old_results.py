"""Results of version 0.1.0 still open, with the same numbers.

``recorded/`` was written by the code of 21 November 2026, which replayed tests/live/replay/recorded/session.h5.
"""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

from live.results import Strain

RECORDED = Path(__file__).with_name("recorded")


def test_results_of_the_first_version_open() -> None:
    with (RECORDED / "strain.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    with Strain.open(RECORDED / "strain.h5") as strain:
        assert strain.versions["phasedic"] == "0.1.0"
        assert strain.n == len(rows) == 8
        for name in ("force_N", "exx", "eyy", "exy", "sigma_eyy", "noise_GL"):
            assert strain.values[name] == pytest.approx([float(row[name]) for row in rows], rel=1e-8)
        maps = strain.maps("eyy")
        assert maps.shape == (8, 4, 6)
        assert np.nanmean(maps, axis=(1, 2)) == pytest.approx(strain.values["eyy"], abs=1e-9)
