"""Words as people type and drop them: patterns that the shell expanded, quotes that stayed, a slash at the end."""

from __future__ import annotations

from pathlib import Path

import pytest

from acquire.addresses import as_typed
from acquire.errors import ConfigError
from live.cli import main
from live.commands.words import understood
from live.config.loading import load_config


@pytest.fixture
def shots(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "my shots").mkdir()
    for name in ("a0.png", "a1.png", "b0.png", "notes.txt"):
        (tmp_path / "my shots" / name).touch()
    (tmp_path / "forces.csv").touch()
    (tmp_path / "r.png").touch()
    return tmp_path / "my shots"


PNG = ["my shots/a0.png", "my shots/a1.png", "my shots/b0.png"]


@pytest.mark.parametrize(
    ("typed", "meant"),
    [
        (["replay", *PNG, "--zoi", "32"], ["replay", "my shots", "--zoi", "32"]),
        (["replay", *PNG, "my shots/notes.txt"], ["replay", "my shots"]),
        (["replay", *PNG[:2]], ["replay", "my shots/a*.png"]),
        (["check", "--camera", *PNG], ["check", "--camera", "my shots"]),
        (["replay", "--report", *PNG], ["replay", "--report", "my shots"]),
        (["replay", "--load", "forces.csv", *PNG], ["replay", "--load", "forces.csv", "my shots"]),
        (["replay", "--reference", "r.png", *PNG], ["replay", "--reference", "r.png", "my shots"]),
        (["replay", "--reference", PNG[0], *PNG], ["replay", "--reference", PNG[0], "my shots"]),
        (["replay", PNG[0], "--load", "forces.csv"], ["replay", PNG[0], "--load", "forces.csv"]),
        (["batch", *PNG], ["batch", *PNG]),
        (["replay", "'my shots'"], ["replay", "my shots"]),
        (["replay", '"my shots" '], ["replay", "my shots"]),
        (["replay", "my shots/"], ["replay", "my shots/"]),
        (["replay", "my shots", "--load", "forces.csv/"], ["replay", "my shots", "--load", "forces.csv"]),
        ([], []),
    ],
)
def test_what_is_typed_is_understood(shots: Path, typed: list[str], meant: list[str]) -> None:
    assert understood(typed) == meant


def test_pictures_that_no_pattern_names_are_refused(shots: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(ConfigError, match=r"2 files are neither .* quote the pattern: 'my shots/\*.png'"):
        understood(["replay", PNG[0], PNG[2]])
    with pytest.raises(SystemExit):
        main(["replay", PNG[0], PNG[2]])
    assert "quote the pattern" in capsys.readouterr().err


def test_a_dropped_path_is_taken_out_of_quotes_and_urls(shots: Path) -> None:
    assert as_typed(f"'{shots}'") == str(shots)
    assert as_typed(f"file://{shots}".replace(" ", "%20")) == str(shots)
    assert as_typed("  ") == "  "
    assert as_typed("/dev/video0?fps=30") == "/dev/video0?fps=30"
    Path("'odd'").touch()
    assert as_typed("'odd'") == "'odd'"
    assert load_config(None, {"camera.address": f'"{shots}"'}).camera.address == str(shots)
