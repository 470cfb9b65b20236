"""Compiled code that another version left behind is ignored, whatever it names."""

from __future__ import annotations

import pickle
from pathlib import Path

import numba
import pytest

from analysis.compiled.loops import helper

# What pickle does with it: import gone.module, then fail.
NAMES_WHAT_IS_GONE = b"cgone.module\nThing\n."


@helper
def twice(x: float) -> float:
    return 2 * x


@pytest.mark.parametrize("version", [numba.__version__, f"{numba.__version__}, loops 0123456789ab"])
def test_an_index_of_other_modules_is_not_read(
    version: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    index = tmp_path / "twice.nbi"
    index.write_bytes(pickle.dumps(version) + NAMES_WHAT_IS_GONE)
    file = twice._cache._cache_file
    monkeypatch.setattr(file, "_index_path", str(index))
    assert file._load_index() == {}
