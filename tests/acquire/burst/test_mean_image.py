"""Means of frames as files: kept to the last bit, and bad ones refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from acquire.burst.mean_image import load_mean, save_mean
from acquire.errors import ConfigError, DataError


def test_means_are_kept_to_the_last_bit(tmp_path: Path) -> None:
    mean = np.random.default_rng(2).normal(100, 30, (20, 30)).astype(np.float32)
    save_mean(mean, tmp_path / "dark.tif")
    np.testing.assert_array_equal(load_mean(str(tmp_path / "dark.tif")), mean)
    with pytest.raises(ConfigError, match="nothing is overwritten"):
        save_mean(mean, tmp_path / "dark.tif")
    with pytest.raises(ConfigError, match="TIFF"):
        save_mean(mean, tmp_path / "dark.png")
    with pytest.raises(DataError, match="cannot be written"):
        save_mean(mean, tmp_path / "nowhere" / "dark.tif")
    assert load_mean(None) is None
    with pytest.raises(DataError, match="no such"):
        load_mean(str(tmp_path / "x.tif"))
    (tmp_path / "text.tif").write_text("no picture")
    with pytest.raises(DataError, match="not an image"):
        load_mean(str(tmp_path / "text.tif"))
