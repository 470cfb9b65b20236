"""A small campaign: three materials, four sessions of each."""

from __future__ import annotations

from pathlib import Path

import pytest

from live.cli import main

KINDS = ("uniform", "hole", "woven")
SETTINGS = ["--zoi", "48", "--step", "12", "--section", "20,2"]
SIZE = "lockstep=yes&seconds=2&fps=12&width=160&height=128&bits=12&hole=10"


@pytest.fixture(scope="package")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the runs ``uniform-1``, ``hole-1`` and so on."""
    folder = tmp_path_factory.mktemp("campaign")
    for kind in KINDS:
        for seed in range(1, 5):
            words = ["--zoi", "32", "--step", "16", "--reference-burst", "4", "--burst", "2"]
            words += ["--no-view", "--no-rrd", "--out", str(folder / f"{kind}-{seed}")]
            assert main(["run", "--camera", f"sim:{kind}?{SIZE}&seed={seed}", "--load", "sim:", *words]) == 0
    return folder


@pytest.fixture(scope="package")
def done(runs: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """All of them replayed by the pool."""
    out = tmp_path_factory.mktemp("done") / "again"
    assert (
        main(["batch", str(runs / "*" / "session.h5"), *SETTINGS, "--workers", "2", "--out", str(out)]) == 0
    )
    return out


@pytest.fixture(scope="package")
def long(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A session of 31 s with 310 bursts."""
    out = tmp_path_factory.mktemp("long") / "long"
    size = "lockstep=yes&seconds=31&fps=10&width=160&height=128&bits=12"
    words = ["--burst", "1", "--reference-burst", "1", "--zoi", "48", "--step", "16", "--no-view", "--no-rrd"]
    assert main(["run", "--camera", f"sim:uniform?{size}", "--load", "sim:", *words, "--out", str(out)]) == 0
    return out / "session.h5"
