"""The command line: bad input gives a clear message and exit code; help shows valid examples; the shell completes."""

from __future__ import annotations

import shlex
import shutil
import subprocess
from pathlib import Path

import cv2
import h5py
import numpy as np
import pytest
import shtab

from live.cli import main
from live.commands.arguments import COMMANDS, EXAMPLES, parse
from live.commands.completion import SHELLS, script
from live.results import Strain


def speckle(seed: int = 1, shape: tuple[int, int] = (96, 128)) -> np.ndarray:
    noise = np.random.default_rng(seed).normal(size=shape).astype(np.float32)
    smooth = cv2.GaussianBlur(noise, (0, 0), 2.0)
    return np.clip(128 + 40 * smooth / smooth.std(), 0, 255).astype(np.uint8)


@pytest.fixture
def shots(tmp_path: Path) -> Path:
    folder = tmp_path / "shots"
    folder.mkdir()
    for i in range(3):
        cv2.imwrite(str(folder / f"a_{i}.png"), speckle())
    return folder


def check_refusal(
    capsys: pytest.CaptureFixture[str], code: int, message: str, *words: str, out: Path
) -> None:
    assert main([*words, "--out", str(out), "--no-view", "--no-rrd"]) == code
    error = capsys.readouterr().err
    assert message in error and "Traceback" not in error


def test_pictures_that_are_cut_off_or_of_another_size_are_left_out(
    capsys: pytest.CaptureFixture[str], shots: Path, tmp_path: Path
) -> None:
    cv2.imwrite(str(shots / "a_3.png"), speckle(shape=(90, 128)))
    cv2.imwrite(str(shots / "a_4.png"), speckle())
    whole = (shots / "a_1.png").read_bytes()
    (shots / "a_1.png").write_bytes(whole[: len(whole) // 2])
    out = tmp_path / "out"
    assert main(["replay", str(shots), "--zoi", "32", "--out", str(out), "--no-view", "--no-rrd"]) == 5
    output = capsys.readouterr().out
    assert "5 pictures: reference 1, measured 2, left out 2" in output
    assert "a_1.png: not an image, or cut off" in output
    assert "a_3.png is 128x90 uint8, but" in output
    with Strain.open(out / "strain.h5") as strain:
        assert strain.values["frame"].tolist() == [2, 4]
        assert strain.values["lost"].tolist() == [1, 1]


def test_a_film_that_is_cut_off(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """It ended with 0, and the end of the test was missing."""
    film = tmp_path / "film.avi"
    writer = cv2.VideoWriter(str(film), cv2.VideoWriter.fourcc(*"FFV1"), 25, (128, 96))
    for seed in range(12):
        writer.write(cv2.cvtColor(speckle(seed // 12), cv2.COLOR_GRAY2BGR))
    writer.release()
    words = ["--zoi", "32", "--no-view", "--no-rrd", "--out"]
    assert main(["replay", str(film), *words, str(tmp_path / "whole")]) == 0
    film.write_bytes(film.read_bytes()[: film.stat().st_size * 2 // 3])
    capsys.readouterr()
    assert main(["replay", str(film), *words, str(tmp_path / "cut")]) == 5
    assert "of 12 frames; it may be cut off" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("name", "content", "words", "code", "message"),
    [
        pytest.param("a_0.png", None, (), 4, "a_0.png", id="a reference that is cut off"),
        pytest.param("a_0.png", (96, 128), (), 4, "pattern", id="a reference without a pattern"),
        pytest.param(
            "mask.png", (10, 10), ("--mask", "mask.png"), 4, "mask.png", id="a mask of another size"
        ),
        pytest.param(
            "b.png", None, ("--roi", "0,0,40,40", "--zoi", "64"), 2, "ZOI", id="a ZOI larger than the ROI"
        ),
    ],
)
def test_pictures_that_cannot_be_measured(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, shots: Path, tmp_path: Path, name: str,
    content: tuple[int, int] | None, words: tuple[str, ...], code: int, message: str,
) -> None:  # fmt: skip
    monkeypatch.chdir(shots)
    if content is None:
        Path(name).write_bytes(b"no picture")
    else:
        cv2.imwrite(name, np.full(content, 128, np.uint8))
    check_refusal(
        capsys, code, message, "replay", "files:a_*.png", "--zoi", "32", *words, out=tmp_path / "out"
    )


def test_foreign_and_truncated_sessions(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    foreign = tmp_path / "foreign.h5"
    with h5py.File(foreign, "w") as file:
        file["x"] = np.arange(3)
    (tmp_path / "cut.h5").write_bytes(foreign.read_bytes()[:700])
    (tmp_path / "text.h5").write_text("this is no HDF5 file")
    for name in ("foreign.h5", "cut.h5", "text.h5"):
        check_refusal(capsys, 4, name, "replay", str(tmp_path / name), out=tmp_path / f"out of {name}")


@pytest.mark.parametrize("name", COMMANDS)
def test_the_help_ends_with_an_example_that_works(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main([name, "--help"])
    assert ended.value.code == 0
    output = capsys.readouterr().out
    assert f"example:\n  {EXAMPLES[name]}\n" in output
    words = shlex.split(EXAMPLES[name].partition(" > ")[0])
    assert words[:2] == ["phasedic", name]
    assert parse(words[1:])[1].command == name


@pytest.mark.skipif(shutil.which("bash") is None, reason="no bash here")
@pytest.mark.parametrize(
    ("typed", "found"),
    [
        ("phasedic re", ["readout", "replay", "report", "recover"]),
        ("phasedic report --pd", ["--pdf"]),
        ("phasedic export run --to v", ["vtk"]),
        ("phasedic replay a --axis ", ["auto", "x", "y"]),
        ("phasedic replay sho", ["shots"]),
    ],
)
def test_bash_completes(tmp_path: Path, typed: str, found: list[str]) -> None:
    (tmp_path / "shots").mkdir()
    (tmp_path / "phasedic.bash").write_text(script("bash"), encoding="utf-8")
    words = [*shlex.split(typed), *([""] if typed.endswith(" ") else [])]
    script_line = (
        f"source ./phasedic.bash; COMP_WORDS=({' '.join(map(shlex.quote, words))}); COMP_CWORD={len(words) - 1};"
        ' _shtab_phasedic; printf "%s\\n" "${COMPREPLY[@]}"'
    )
    done = subprocess.run(
        ["bash", "-c", script_line], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert done.stderr == ""
    assert set(done.stdout.split()) == set(found)


@pytest.mark.parametrize("shell", SHELLS)
def test_a_script_names_every_command(shell: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["completion", shell]) == 0
    output = capsys.readouterr().out
    assert [name for name in COMMANDS if name not in output] == []


def test_the_shells_are_known_to_shtab() -> None:
    assert set(SHELLS) <= set(shtab.SUPPORTED_SHELLS)
