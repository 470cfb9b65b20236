"""The example that reads a finished run does what it says."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from examples.finished_run import main
from tests.live.made_run import PULLED, make_run


def test_it_reads_and_writes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = make_run(tmp_path)
    assert main(str(folder)) == 0
    said = capsys.readouterr().out
    assert f"S1: {len(PULLED)} measurements, force up to 4210 N" in said
    assert "pictures: 128 x 96 px" in said
    assert (folder / "from_python" / "report.html").is_file()
    with np.load(folder / "from_python" / "strain.npz") as held:
        assert held["v"].shape[0] == len(PULLED)
