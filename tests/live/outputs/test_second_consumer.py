"""The example of a consumer of one's own does what it says."""

from __future__ import annotations

from pathlib import Path

import pytest

from examples.second_consumer import main


def test_it_sees_every_measurement_and_stands_in_the_report(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(str(tmp_path / "run")) == 0
    lines = capsys.readouterr().out.splitlines()
    printed = [line for line in lines if line.endswith("um/m") and line[:4].strip().isdigit()]
    (report,) = [line for line in lines if line.startswith("largest strain:")]
    assert "the last was" in report
    assert len(printed) >= 3
    assert printed[-1].split()[1] in report
