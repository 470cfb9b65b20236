"""A reference with less noise than what follows: kept, honest, and alike live and in a replay."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from live.results.reader import Strain
from tests.accuracy.truth import Speckle, affine
from tests.live.test_end_to_end import assert_replay_is_bit_equal, live_run, strains

NOISE_GL = (1, 1, 1, 1, 1, 2, 2, 3, 3, 5, 5)
"""By picture; the first four make the reference."""
STEP_PX = 0.3


@pytest.fixture(scope="module")
def pictures(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder, rng = tmp_path_factory.mktemp("pictures"), np.random.default_rng(2)
    for k, noise in enumerate(NOISE_GL):
        level = 255 * Speckle(2.0, 1).at(*affine((176, 176), u=STEP_PX * max(0, k - 3)))
        image = np.clip(np.rint(level + rng.normal(0, noise, level.shape)), 0, 255).astype(np.uint8)
        cv2.imwrite(str(folder / f"shot_{k:02d}.png"), image)
    return folder


@pytest.mark.parametrize("stated", [None, 1.0])
def test_live_and_replay_agree_where_the_noise_grows(
    pictures: Path, tmp_path: Path, stated: float | None
) -> None:
    folder = tmp_path / "run"
    measured: dict[str, float] = {"measure.zoi": 32, "measure.step": 16, "measure.burst": 1}
    if stated is not None:
        measured["measure.noise_GL"] = stated
    live_run(folder, camera=f"files:{pictures}?fps=20", **measured)
    assert_replay_is_bit_equal(folder, tmp_path / "again")
    with Strain.open(folder / "strain.h5") as strain:
        instants = len(strain.time_s)
    assert instants == len(NOISE_GL) - 4
    found = strains(folder)
    assert np.mean(found["status"] == 0) > 0.99
    ratios = []
    for k, u in enumerate(found["u"]):
        sigma = found["sigma_exx"][k]
        ratios.append(np.sqrt(np.nanmean(sigma**2) / np.nanmean(found["exx"][k] ** 2)))
        assert np.nanmean(u) == pytest.approx(STEP_PX * (k + 1), abs=0.02)
    assert np.mean(ratios) == pytest.approx(1, abs=0.12)
    assert np.nanmean(found["sigma_exx"][-1]) > 2.5 * np.nanmean(found["sigma_exx"][0])
