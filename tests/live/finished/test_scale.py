"""The scale that the test was configured with is that of its report and exports."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from live.cli import main
from live.finished import open_run
from tests.live.made_run import CONFIG, make_run


@pytest.fixture(scope="module")
def scaled(tmp_path_factory: pytest.TempPathFactory) -> Path:
    config = {**CONFIG, "scale": {"mm_per_px": 0.05}}
    return make_run(tmp_path_factory.mktemp("scaled"), [0.0, 1e-3], config=config)


@pytest.mark.parametrize(("more", "scale"), [([], 0.05), (["--scale", "0.1"], 0.1)])
def test_lengths_are_in_mm(scaled: Path, tmp_path: Path, more: list[str], scale: float) -> None:
    out = tmp_path / "a.npz"
    assert main(["export", str(scaled), "--to", "npz", "--mm", *more, "--out", str(out)]) == 0
    with np.load(out) as held, open_run(scaled) as run:
        np.testing.assert_allclose(held["v"], scale * run.strain.maps("v"), rtol=1e-6)


def test_the_report_shows_it(scaled: Path, tmp_path: Path) -> None:
    assert main(["report", str(scaled), "--out", str(tmp_path / "r.html")]) == 0
    assert "0.05 mm/px" in (tmp_path / "r.html").read_text(encoding="utf-8")


@pytest.mark.parametrize("said", [None, "0.05", -1, 0, True, math.nan, math.inf, [1]])
def test_what_is_no_scale_is_none(tmp_path: Path, said: object) -> None:
    with open_run(make_run(tmp_path, [0.0], config={**CONFIG, "scale": {"mm_per_px": said}})) as run:
        assert run.mm_per_px is None
