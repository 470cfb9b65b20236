"""png, mp4, webm, gif: the map follows the specimen; files are complete, and refusals have a message."""

from __future__ import annotations

import itertools
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from acquire.errors import ConfigError, DataError
from analysis.field.strain_field import StrainField
from live.cli import main
from live.config.new_files import new_file
from live.results.export import maps
from live.results.export.formats import FORMATS, ExportRequest, export
from live.results.export.job import ExportJob, ExportOptions
from live.results.maps.painting import Levels, Painter
from live.results.maps.scale import ColourScale
from live.results.quantities import Display
from live.results.run_folder import open_run
from live.ui.terminal.screen import TerminalScreen
from tests.live.ended import code_of
from tests.live.made_run import make_run
from tests.live.made_up import make_grid

ZOOM = 4.375
SIZE = (560, 420)  # 128 x 96 px


def frames_of(path: Path) -> list[np.ndarray]:
    film = cv2.VideoCapture(str(path))
    found = []
    while (read := film.read())[0]:
        found.append(read[1])
    return found


def redness(image: np.ndarray) -> np.ndarray:
    return image[..., 2].astype(float) - image[..., 0]


@pytest.mark.parametrize("name", ["f.mp4", "f.webm"])
def test_films(run_dir: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str) -> None:
    assert main(["export", str(run_dir), "--to", "mp4", "--out", str(tmp_path / name), "--fps", "5"]) == 0
    assert "do not play it" in capsys.readouterr().out
    frames = frames_of(tmp_path / name)
    assert len(frames) == 12
    middle = np.s_[100:300, 100:400]
    assert redness(frames[-1])[middle].mean() > redness(frames[0])[middle].mean() + 40


@pytest.mark.parametrize("field", ["eyy", "status", "v", "sigma_eyy"])
def test_pictures(run_dir: Path, tmp_path: Path, field: str) -> None:
    out = tmp_path / "p"
    assert (
        main(["export", str(run_dir), "--to", "png", "--out", str(out), "--fields", field, "--from", "1"])
        == 0
    )
    assert [path.name for path in sorted(out.iterdir())] == [f"{field}_00000.png", f"{field}_00001.png"]
    drawn = cv2.imread(str(out / f"{field}_00001.png"))
    assert drawn.shape[1] > SIZE[0] * 0.85
    assert drawn.std() > 5


def test_a_film_without_an_ending_gets_one(run_dir: Path, tmp_path: Path) -> None:
    assert main(["export", str(run_dir), "--to", "mp4", "--out", str(tmp_path / "film"), "--from", "1"]) == 0
    assert [path.name for path in tmp_path.iterdir()] == ["film.mp4"]


def test_a_gif_stays_below_its_limit(run_dir: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    words = ["export", str(run_dir), "--to", "gif", "--from", "1", "--out"]
    assert main([*words, str(tmp_path / "free.gif")]) == 0
    free = (tmp_path / "free.gif").stat().st_size
    monkeypatch.setattr(maps, "MAX_GIF_BYTES", free // 2)
    assert main([*words, str(tmp_path / "small.gif")]) == 0
    assert 1000 < (tmp_path / "small.gif").stat().st_size <= free // 2


def moved(number: int, strain: float) -> StrainField:
    """Everything has gone by 30 px to the right; nothing is strained but one ZOI."""
    grid = make_grid()
    eyy = np.zeros(grid.shape)
    eyy[2, 2] = 0.01
    return StrainField.from_values(grid, {"u": 30.0, "dv_dy": eyy}, 1e-5)


def test_a_map_moves_with_its_specimen(tmp_path: Path) -> None:
    with open_run(make_run(tmp_path, [0.0], session=False, field_of=moved)) as run:
        scale = ColourScale.of_run(run.strain, "eyy", [0], limit=0.01)
        painter = Painter(run.strain, "eyy", scale, (128, 96))
        assert painter.size == SIZE
        base = painter.picture(np.full((96, 128), 100, np.uint8), Levels(0, 255))
        painted = painter.over(base, 0)
        grid = run.strain.grid
        rows, columns = np.nonzero(redness(painted) > 60)
    place = grid.x[2] + 30, grid.y[2]
    assert np.mean(columns) == pytest.approx((place[0] + 0.5) * ZOOM, abs=1.5)
    assert np.mean(rows) == pytest.approx((place[1] + 0.5) * ZOOM, abs=1.5)
    # Left of the specimen there is the picture as it was.
    np.testing.assert_array_equal(painted[:, : round(25 * ZOOM)], base[:, : round(25 * ZOOM)])


@pytest.mark.parametrize("kind", FORMATS)
def test_nothing_is_overwritten(
    run_dir: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], kind: str
) -> None:
    out = tmp_path / ("f.mp4" if kind == "mp4" else "x")
    out.write_text("precious")
    assert main(["export", str(run_dir), "--to", kind, "--out", str(out)]) == 2
    assert "exists already and is not overwritten" in capsys.readouterr().err
    assert out.read_text() == "precious"
    assert list(tmp_path.iterdir()) == [out]


@pytest.mark.parametrize(
    ("code", "message", "arguments"),
    [
        (2, "there is no such map", ["--fields", "ezz"]),
        (2, "one map at a time", ["--to", "tiff", "--fields", "exx,eyy"]),
        (2, "no measurement between 5 and 6 s; the test has 0 to 1.1 s", ["--from", "5", "--until", "6"]),
        (2, "--mm needs the scale", ["--mm"]),
        (2, "has no effect without --mm", ["--scale", "0.1"]),
        (2, "mm/px is not possible", ["--mm", "--scale", "-1"]),
        (2, "--fps: '0': give a number from 0.1 to 240", ["--to", "gif", "--fps", "0"]),
        (2, ".mp4 or .webm", ["--to", "mp4", "--out", "film.avi"]),
    ],
)
def test_arguments(
    run_dir: Path, capsys: pytest.CaptureFixture[str], code: int, message: str, arguments: list[str]
) -> None:
    kind = [] if "--to" in arguments else ["--to", "csv"]
    assert code_of(["export", str(run_dir), *kind, *arguments]) == code
    assert message in capsys.readouterr().err


def test_broken_files_end_in_words(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["export", str(tmp_path), "--to", "npz"]) == 4
    assert "no strain.h5 there" in capsys.readouterr().err
    make_run(tmp_path)
    (tmp_path / "session.h5").write_bytes((tmp_path / "session.h5").read_bytes()[:5000])
    assert main(["export", str(tmp_path), "--to", "png", "--from", "4"]) == 0
    output = capsys.readouterr().out
    assert "note: the recording cannot be read, the results can: " in output and "session.h5" in output
    whole = (tmp_path / "strain.h5").read_bytes()
    (tmp_path / "strain.h5").write_bytes(whole[: len(whole) // 2])
    assert main(["export", str(tmp_path), "--to", "npz"]) == 4
    assert "strain.h5" in capsys.readouterr().err
    assert not (tmp_path / "export" / "strain.npz").exists()


def test_a_run_without_measurements(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    make_run(tmp_path, [], session=False)
    assert main(["export", str(tmp_path), "--to", "csv"]) == 4
    assert "holds no measurement" in capsys.readouterr().err


@pytest.mark.parametrize("error", [KeyboardInterrupt(), ValueError("a defect"), OSError(28, "No space left")])
def test_what_fails_leaves_nothing(tmp_path: Path, error: BaseException) -> None:
    expected = DataError if isinstance(error, OSError) else type(error)
    with pytest.raises(expected), new_file(tmp_path / "deep" / "a.csv") as part:
        part.write_text("half")
        raise error
    assert list((tmp_path / "deep").iterdir()) == []


def test_a_name_taken_meanwhile_is_not_overwritten(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="exists already"), new_file(tmp_path / "a.csv") as part:
        part.write_text("new")
        (tmp_path / "a.csv").write_text("precious")
    assert (tmp_path / "a.csv").read_text() == "precious"
    assert list(tmp_path.iterdir()) == [tmp_path / "a.csv"]


def test_progress_is_told_after_two_seconds(run_dir: Path, capsys: pytest.CaptureFixture[str]) -> None:
    clock = iter(range(100))

    def now() -> float:
        return 0.5 * next(clock)

    ticks = itertools.count(0, 10)
    screen = TerminalScreen(now=lambda: next(ticks))
    with open_run(run_dir) as run:
        rows = run.strain.rows_between(None, None, "--from, --until")
        job = ExportJob(run, ("eyy",), rows, Display(), screen, ExportOptions())
        assert [row for _, row in job.steps(now)] == list(rows)
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("instant 4 of 12, about 5 s left")
    assert len(lines) == 8


@pytest.mark.parametrize(("form", "library"), [("tiff", "tifffile"), ("gif", "PIL")])
def test_without_its_library_a_format_says_what_to_install(
    run_dir: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, form: str, library: str
) -> None:
    monkeypatch.setitem(sys.modules, library, None)
    with open_run(run_dir) as run, pytest.raises(ConfigError, match=r"pip install 'phasedic\[export\]'"):
        export(run, ExportRequest(form, tmp_path / "x"), TerminalScreen(quiet=True))
    assert not list(tmp_path.iterdir())
