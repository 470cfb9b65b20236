"""A replay of pictures says which is the reference, takes them in one order, and says what it leaves out."""

from __future__ import annotations

from pathlib import Path

import pytest

from acquire.frame import CameraInfo
from live.cli import main
from live.config.loading import Config
from live.results import Strain
from live.results.figures import film_line, tensile_options
from live.setup.pictures import with_film
from tests.live.shots import write_shots

SHAPE, STRAINS = (96, 112), (0.0, 0.001, 0.002)
SMALL = ["--zoi", "48", "--step", "24", "--roi", "all", "--no-view", "--no-rrd"]


def shots(folder: Path, *names: str) -> Path:
    """Pictures with strains of 0, 1000, 2000 um/m under these names."""
    return write_shots(folder, SHAPE, STRAINS[: len(names)], names)


def replayed(capsys: pytest.CaptureFixture[str], source: Path, *words: str) -> tuple[int, str, list[float]]:
    out = source.parent / f"out{len([*source.parent.iterdir()])}"
    capsys.readouterr()
    code = main(["replay", str(source), *SMALL, "--out", str(out), *words])
    said = capsys.readouterr()
    if not (out / "strain.h5").exists():
        return code, said.err, []
    with Strain.open(out / "strain.h5") as strain:
        return code, said.out, [float(value) for value in strain.values["eyy"]]


def test_the_first_line_and_a_mask(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    source = shots(tmp_path / "shots", "ref.png", "def_2.png", "def_10.png")
    (source / "mask.png").write_bytes((source / "def_2.png").read_bytes())
    code, said, strains = replayed(capsys, source)
    assert code == 5
    assert said.splitlines()[0] == "reference ref.png, last def_10.png, 3 pictures"
    assert "mask.png is a mask by its name" in said
    assert strains == pytest.approx([0.001, 0.002], abs=1e-4)


def test_a_counter_that_begins_again_is_asked_and_answered(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    source = shots(tmp_path / "shots", "v1.2.png", "v1.10.png", "v1.11.png")
    code, said, _ = replayed(capsys, source)
    assert code == 2
    assert "v1.2.png" in said
    assert "give --reference NAME, --order time or --order name" in said
    for words in (["--reference", "v1.2.png"], ["--order", "name"], ["--order", "time", "--order", "1"]):
        code, said, strains = replayed(capsys, source, *words)
        assert code == 0
        assert said.startswith("reference v1.2.png")
        assert strains[-2:] == pytest.approx([0.001, 0.002], abs=1e-4)


def test_one_picture_alone(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    source = shots(tmp_path / "shots", "a.png")
    code, said, _ = replayed(capsys, source)
    assert code == 4
    assert "one picture alone has no strain; give the folder that the others are in" in said
    code, _, strains = replayed(capsys, source, "--reference", str(source / "a.png"))
    assert (code, strains) == (0, pytest.approx([0.0], abs=1e-6))


def test_a_session_has_its_own_order(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    source = shots(tmp_path / "shots", "a0.png", "a1.png", "a2.png")
    run = ["run", "--camera", f"files:{source}", "--burst", "1", *SMALL, "--out", str(tmp_path / "run")]
    assert main(run) == 0
    code, said, _ = replayed(capsys, tmp_path / "run" / "session.h5")
    assert (code, said.splitlines()[0]) == (0, "reference frame 1, last frame 3, 3 pictures")
    code, said, _ = replayed(capsys, tmp_path / "run" / "session.h5", "--order", "time")
    assert code == 2
    assert "has an order of its own" in said


def test_a_film_that_holds_motion_back_has_a_limit_of_error() -> None:
    def camera(inter_frame: bool) -> CameraInfo:
        controls = {"inter_frame": inter_frame}
        return CameraInfo("video:a", "a", 10, 10, 8, live=False, clock="nominal", controls=controls)

    specimen = with_film(Config(), camera(True)).specimen
    assert specimen.film_error_percent == 10
    assert "not better than 10 %" in film_line(specimen)[0]
    assert tensile_options(specimen).limits.shares(1.0) == {"film": pytest.approx(0.1 / 3**0.5)}
    assert with_film(Config(), camera(False)).specimen.film_error_percent is None
    assert film_line(Config().specimen) == []
