"""The check before a test: a good picture is ready, a bad one is not, and the reason is told."""

from __future__ import annotations

import pytest

from live.cli import main

STILL = "sim:uniform?bits=8&fps=50&seconds=20&width=224&height=192&lockstep=yes"


def checked(capsys: pytest.CaptureFixture[str], more: str, *arguments: str) -> tuple[int, str]:
    small = ["--zoi", "48", "--step", "16", "--reference-burst", "16"]
    code = main(["check", "--camera", STILL + more, *small, *arguments])
    return code, capsys.readouterr().out


def test_a_good_picture_is_ready(capsys: pytest.CaptureFixture[str]) -> None:
    code, said = checked(capsys, "")
    assert code == 0, said
    assert "LOOK" not in said
    assert said.rstrip().endswith("ready")


@pytest.mark.parametrize(
    ("more", "arguments", "says"),
    [
        ("&radius=12", (), "LOOK  speckle radius"),
        ("&contrast=3", (), "LOOK  contrast"),
        ("", ("--target", "5"), "more than the 5.0 um/m asked for"),
        ("&hold=0.01&end=0.1&drift_x=40", (), "LOOK  motion"),
    ],
)
def test_a_bad_picture_is_not(
    capsys: pytest.CaptureFixture[str], more: str, arguments: tuple[str, ...], says: str
) -> None:
    code, said = checked(capsys, more, *arguments)
    assert code == 6, said
    assert says in said


def test_too_short(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", "--camera", STILL, "--reference-burst", "4"]) == 2
    assert "too short for a check" in capsys.readouterr().err
    assert main(["check"]) == 2
