"""What the words of a command line mean: settings, sections, scales, studies; and as people type and drop them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from acquire.addresses import as_typed
from acquire.errors import ConfigError
from analysis.field import Blur
from live import VERSION
from live.cli import main
from live.commands.arguments import COMMANDS, parse, understood
from live.commands.check import RenewedLines, blur_line, peak_line, short_line
from live.commands.options import configured, overrides
from live.commands.report import _first_free, _targets
from live.commands.scale import board_of
from live.commands.study import _csv, _line, _settings
from live.config.loading import Config, load_config
from live.replay.study import NO_WINDOW, StudyResult, StudySetting
from live.setup.check.lines import CheckLine
from live.setup.check.quick_check import QuickCheck
from live.setup.scale import Board
from live.ui.terminal.screen import TerminalScreen
from tests.live.screens import Terminal


def given(*words: str) -> Any:
    return parse(list(words))[1]


def test_options_win_over_the_file_and_the_file_over_defaults(tmp_path: Path) -> None:
    rig = tmp_path / "rig.toml"
    rig.write_text("[measure]\nzoi = 48\nstep = 12\n[specimen]\nwidth_mm = 9\n")
    words = given("run", "--camera", "sim:", "--config", str(rig), "--zoi", "32", "--section", "20,2")
    found = configured(words, {"measure.step": 4, "measure.zoi": 8, "measure.burst": 6})
    assert (found.measure.zoi, found.measure.burst) == (32, 6)
    assert (found.specimen.width_mm, found.specimen.thickness_mm) == (20.0, 2.0)
    assert found.specimen.area_m2 == pytest.approx(40e-6)


def test_no_command_lists_them(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        parse([])
    out, err = capsys.readouterr()
    assert (ended.value.code, out) == (2, "") and all(f"\n    {name}" in err for name in COMMANDS)


def test_the_version_alone(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as end:
        parse(["--version"])
    assert (end.value.code, capsys.readouterr().out) == (0, f"phasedic {VERSION}\n")


def test_metadata_and_a_lens_that_is_left_out() -> None:
    found = overrides(
        given("run", "--camera", "sim:", "--meta", "operator=A=B", "--meta", "note=", "--no-lens")
    )
    assert (found["metadata.operator"], found["metadata.note"], found["lens"]) == ("A=B", "", {})
    with pytest.raises(ConfigError, match="give width,thickness in mm"):
        overrides(given("run", "--camera", "sim:", "--section", "20"))


def test_a_study_has_all_its_settings_once() -> None:
    words = given("study", "session.h5", "--zoi", "24,32,24", "--order", "1,2")
    assert [(one.zoi, one.step, one.order) for one in _settings(words)] == [
        (24, 6, 1), (24, 6, 2), (32, 8, 1), (32, 8, 2),
    ]  # fmt: skip
    words = given("study", "session.h5", "--zoi", "2", "--static", "none", "--loaded", "3,4.5")
    assert _settings(words) == [StudySetting(2, 1, 1, "gaussian")]
    assert (words.static, words.loaded) == (NO_WINDOW, (3.0, 4.5))
    with pytest.raises(SystemExit):
        given("study", "session.h5", "--loaded", "4,4")


STUDIED = StudyResult(
    StudySetting(32, 8, 1, "uniform"), 20e-6, 10e-6, 80.0, 24.5, 1.5e-3, 5e-6, 12.5e-6, 0.875, measured=True
)  # fmt: skip


def test_the_line_and_the_table_of_a_study() -> None:
    words = _line(STUDIED).split()
    assert words == ["32", "8", "1", "uniform", "80.0", "24.5", "20.0", "2.00", "1500", "5", "12.5", "88%"]
    head, row = (line.split(",") for line in _csv([STUDIED]).splitlines())
    assert dict(zip(head, row, strict=True)) == {
        "zoi": "32", "step": "8", "order": "1", "window": "uniform", "l10": "80", "vsg": "24.5",
        "noise": "2e-05", "predicted": "1e-05", "seen": "0.0015", "sigma": "5e-06", "gradient": "1.25e-05",
        "valid": "0.875",
    }  # fmt: skip


def test_two_points_are_x_and_y_of_the_one_and_then_of_the_other(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rig = tmp_path / "rig.toml"
    rig.write_text("[measure]\nzoi = 48\n")
    words = ["scale", "--config", str(rig), "--points", "10,20,310,420", "--length", "25"]
    assert main(words) == 0
    assert "give --stand-off MM" in capsys.readouterr().out
    assert main([*words, "--stand-off", "500"]) == 0
    said = capsys.readouterr().out
    assert "scale: 0.05 " in said, "500 px are 25 mm"
    assert "0.1 mm toward the camera at a stand-off of 500 mm gives a false strain of 200 µm/m" in said
    found = load_config(rig, {})
    assert (found.scale.mm_per_px, found.scale.stand_off_mm, found.measure.zoi) == (0.05, 500.0, 48)


def test_a_board_has_columns_first() -> None:
    board = board_of(given("scale", "--checkerboard", "9x6", "--square", "5"))
    assert board == Board(9, 6, 5.0, 0.0)
    board = board_of(given("scale", "--charuco", "7X5", "--square", "5", "--marker", "3"))
    assert board == Board(7, 5, 5.0, 3.0)
    with pytest.raises(ConfigError, match="--marker MM is needed"):
        board_of(given("scale", "--charuco", "7x5", "--square", "5"))


def quick(sharpness: float, peak: float, blur: Blur) -> Any:
    return QuickCheck(SimpleNamespace(sharpness=sharpness), peak, blur)  # type: ignore[arg-type]


def test_the_bar_of_the_sharpness_ends_at_the_peak() -> None:
    half = quick(0.15, 0.3, Blur(0.4, 0.02))
    assert peak_line(half) == f"sharpness 0.150 [{'#' * 15}{'.' * 15}] 50% of the peak 0.300"
    assert blur_line(half) == ["          less sharp by 0.40 ± 0.02 px than the sharpest picture so far"]
    none = quick(float("nan"), 0.0, Blur(float("nan"), float("nan")))
    assert (peak_line(none), blur_line(none)) == ("sharpness: no pattern is visible", [])


def test_the_short_line_names_what_is_not_well() -> None:
    one, other = CheckLine("light", "dark", good=False), CheckLine("noise", "2 GL")
    half = quick(0.15, 0.3, Blur(0.4, 0.02))
    assert short_line(half, [one, other]) == "sharpness 0.150, peak 0.300; LOOK: light"
    assert short_line(half, [other]) == "sharpness 0.150, peak 0.300; all well"


def test_lines_are_renewed_over_as_many_as_there_were(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("live.commands.check.shutil.get_terminal_size", lambda: (6, 5))
    stream = Terminal()
    lines = RenewedLines(TerminalScreen(stream), stream)
    lines.lines(["one", "two\nparts", "four", "five"], "short")
    assert stream.getvalue() == "\x1b[2Kone\n\x1b[2Ktwo\n\x1b[2Kparts\n\x1b[0J", "three of a height of five"
    stream.truncate(0)
    stream.seek(0)
    lines.lines(["a\x1b longer one"], "short")
    assert stream.getvalue() == "\x1b[3A\x1b[2Ka\\x1b\n\x1b[0J", "cut to the width, and printable"


def test_a_page_gets_a_number_where_it_or_what_is_saved_beside_it_is_there(tmp_path: Path) -> None:
    page = tmp_path / "report.html"
    words = given("report", str(tmp_path), "--compare", str(tmp_path), "--pdf")
    assert [one.name for one in _targets(page, words)] == ["report.html", "report.csv", "report.pdf"]
    assert _first_free(page, words) == page
    (tmp_path / "report.csv").touch()
    (tmp_path / "report-2.pdf").touch()
    assert _first_free(page, words).name == "report-3.html"


def test_a_second_camera_makes_a_run_of_two_sides(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    taken: list[list[str]] = []

    def run_attended(configs: Mapping[str, Config], screen: object) -> SimpleNamespace:
        taken.append(list(configs))
        return SimpleNamespace(exit_code=42)

    monkeypatch.setattr("live.commands.run.run_attended", run_attended)
    monkeypatch.setattr("live.commands.run.finish", lambda outcome, screen, verbose: outcome.exit_code)
    words = ["run", "--camera", "sim:", "--load", "none:", "--out", str(tmp_path / "run")]
    assert main([*words, "--back", "sim:?side=back"]) == 42
    assert main([*words, "--beside", "sim:", "--beside", "sim:", "--beside", "sim:"]) == 42
    assert main(words) == 42
    assert taken == [["front", "back"], ["first", "second", "third", "fourth"], [""]]


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
