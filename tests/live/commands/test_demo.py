"""The demo: its exit code is that of what was measured."""

from __future__ import annotations

from pathlib import Path

import pytest

from acquire.errors import Interrupted
from analysis import PICTURE_KINDS
from live.cli import main
from live.commands import demo

SHORT = ["--seconds", "2", "--fps", "10", "--reference-burst", "2", "--burst", "2", "--step", "64"]


@pytest.mark.parametrize(("agreed", "code"), [pytest.param(True, 5, marks=pytest.mark.slow), (False, 1)])
def test_without_a_modulus_it_says_so(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    agreed: bool,
    code: int,
) -> None:
    """As on a busy machine, which measures few bursts of the elastic part; it ended with 0."""
    monkeypatch.setattr(demo, "_print_strain", lambda *values: agreed)
    words = ["demo", *SHORT, "--no-view", "--no-rrd", "--out", str(tmp_path / "out")]
    assert main(words) == code
    output = capsys.readouterr().out
    assert "E is not known: " in output and "E  not known, true 70 GPa" in output
    assert ("exit code 5: E was not measured (" in output) is agreed


def test_it_compiles_what_every_kind_of_picture_needs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What that spares the next commands: test_compiled_once.py."""
    asked: list[tuple[object, object]] = []

    def compile_ahead(kinds: object, *, phase: bool, show: object) -> None:
        asked.append((kinds, phase))
        raise Interrupted("enough")

    monkeypatch.setattr(demo, "compile_ahead", compile_ahead)
    assert main(["demo", "--out", str(tmp_path / "out")]) == 130
    assert asked == [(PICTURE_KINDS, True)]
