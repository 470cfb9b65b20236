"""Nothing overwritten, nothing half written, and every refusal in words."""

from __future__ import annotations

import itertools
import sys
from pathlib import Path

import pytest

from acquire.errors import ConfigError, DataError
from live.cli import main
from live.export import FORMATS, ExportRequest, export, new_file
from live.export.job import Job, Options, chosen_rows
from live.finished import Display, open_run
from live.tell import TerminalScreen
from tests.live.made_run import make_run


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
    ("code", "says", "arguments"),
    [
        (2, "there is no such map", ["--fields", "ezz"]),
        (2, "one map at a time", ["--to", "tiff", "--fields", "exx,eyy"]),
        (2, "no measurement between 5 and 6 s; they reach from 0 to 1.1 s", ["--from", "5", "--until", "6"]),
        (2, "--mm needs the scale", ["--mm"]),
        (2, "does nothing without --mm", ["--scale", "0.1"]),
        (2, "mm/px is not possible", ["--mm", "--scale", "-1"]),
        (2, "--fps 0 is not possible", ["--fps", "0"]),
        (2, ".mp4 or .webm", ["--to", "mp4", "--out", "film.avi"]),
    ],
)
def test_arguments(
    run_dir: Path, capsys: pytest.CaptureFixture[str], code: int, says: str, arguments: list[str]
) -> None:
    assert main(["export", str(run_dir), "--to", "csv", *arguments]) == code
    assert says in capsys.readouterr().err


def test_broken_files_end_in_words(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["export", str(tmp_path), "--to", "npz"]) == 4
    assert "no strain.h5 there" in capsys.readouterr().err
    make_run(tmp_path)
    (tmp_path / "session.h5").write_bytes((tmp_path / "session.h5").read_bytes()[:5000])
    assert main(["export", str(tmp_path), "--to", "png"]) == 4
    assert "session.h5" in capsys.readouterr().err
    assert main(["export", str(tmp_path), "--to", "png", "--no-picture", "--from", "4"]) == 0
    whole = (tmp_path / "strain.h5").read_bytes()
    (tmp_path / "strain.h5").write_bytes(whole[: len(whole) // 2])
    assert main(["export", str(tmp_path), "--to", "npz"]) == 4
    assert "strain.h5" in capsys.readouterr().err
    assert not (tmp_path / "export" / "strain.npz").exists()


def test_a_run_without_measurements(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    make_run(tmp_path, [], session=False)
    assert main(["export", str(tmp_path), "--to", "csv"]) == 2
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
        rows = chosen_rows(run.strain, None, None)
        job = Job(run, ("eyy",), rows, Display(), screen, Options())
        assert [row for _, row in job.steps(now)] == list(rows)
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("instant 4 of 12, about 5 s left")
    assert len(lines) == 8


def test_a_map_of_statuses_has_no_missing_values(run_dir: Path, tmp_path: Path) -> None:
    with open_run(run_dir) as run:
        export(run, ExportRequest("tiff", tmp_path / "s.tif", "status"), TerminalScreen(quiet=True))
    assert (tmp_path / "s.tif").stat().st_size > 12 * 4 * 5 * 7


@pytest.mark.parametrize(("form", "library"), [("tiff", "tifffile"), ("gif", "PIL")])
def test_without_its_library_a_format_says_what_to_install(
    run_dir: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, form: str, library: str
) -> None:
    monkeypatch.setitem(sys.modules, library, None)
    with open_run(run_dir) as run, pytest.raises(ConfigError, match=r"pip install 'phasedic\[export\]'"):
        export(run, ExportRequest(form, tmp_path / "x"), TerminalScreen(quiet=True))
    assert not list(tmp_path.iterdir())
