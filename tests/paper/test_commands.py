"""The paper reproduced on rendered truth, its commands, and other people's programs where they are found."""

from __future__ import annotations

import argparse
import io
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

import tests.paper.others as others
import tests.paper.peers as peers
from acquire.errors import ConfigError, DataError
from acquire.frame import frozen
from hw_mocks.deformation import Affine
from hw_mocks.speckle import Speckle
from live.commands import characterise
from live.commands.inspect import add_arguments as add_inspect
from live.commands.inspect import command as inspect
from live.setup.pattern.outcome import ExperimentContext, ExperimentOutcome, ProgressBar, page
from tests.acquire.session.fixtures import CAMERA, frame, writer
from tests.live.screens import Terminal
from tests.paper.__main__ import EXPERIMENTS, add_arguments, chosen, command, run
from tests.paper.outcomes import Comparison, comparison_summary, write_page
from tests.paper.peers import present


def parsed(*words: str) -> argparse.Namespace:
    parser = argparse.ArgumentParser()
    add_arguments(parser)
    return parser.parse_args(words)


def own(*words: str) -> int:
    """``phasedic characterise``."""
    parser = argparse.ArgumentParser()
    characterise.add_arguments(parser)
    return characterise.command(parser.parse_args(words))


@pytest.fixture
def picture(tmp_path: Path) -> Path:
    import cv2

    levels = np.rint(Speckle((180, 220), 2.0, seed=6).reference() * 255).astype(np.uint8)
    cv2.imwrite(str(tmp_path / "mine.png"), levels)
    return tmp_path / "mine.png"


def test_names_are_checked_and_ordered() -> None:
    assert chosen(None) == list(EXPERIMENTS)
    assert chosen(["fig3", "fig1"]) == ["fig1", "fig3"]
    with pytest.raises(ConfigError, match="fig9: not known"):
        chosen(["fig1", "fig9"])


def test_a_run_takes_up_what_it_has(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[str] = []

    def experiment(name: str, context: ExperimentContext) -> ExperimentOutcome:
        calls.append(name)
        context.tick(0.5)
        return ExperimentOutcome(name, name, "words")

    monkeypatch.setattr("tests.paper.__main__._timed", experiment)
    context = ExperimentContext(tmp_path, quick=True)
    screen = io.StringIO()
    run(["fig1"], context, screen)
    again = run(["fig1", "fig3"], context, screen)
    assert calls == ["fig1", "fig3"]
    assert [outcome.name for outcome in again] == ["fig1", "fig3"]
    run(["fig1"], replace(context, quick=False), screen)
    assert calls == ["fig1", "fig3", "fig1"]
    assert "stored" in screen.getvalue()


def test_progress_is_a_bar_on_a_terminal_only() -> None:
    terminal, log = Terminal(), io.StringIO()
    for screen in (terminal, log):
        progress = ProgressBar("fig1", screen)
        progress(0.5)
        progress.done("1.0 s")
    assert "50 %" in terminal.getvalue()
    assert terminal.getvalue().endswith("1.0 s\n")
    assert log.getvalue() == "fig1         1.0 s\n"
    ProgressBar("fig1", None).done("nowhere")


def test_fig1_end_to_end(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out, target = tmp_path / "images", tmp_path / "page.md"
    words = ["--quick", "--only", "fig1", "open-hole", "--out", str(out), "--page", str(target)]
    assert command(parsed(*words)) == 0
    text = target.read_text(encoding="utf-8")
    assert "](images/fig1_phases.png)" in text
    assert "--data DIR" in text  # what is missing is named
    assert (out / "fig1_phases.png").stat().st_size > 10_000
    assert (out / "fig1_phases.csv").read_text(encoding="utf-8").startswith("kx rad/px,")
    assert "page:" in capsys.readouterr().out


def test_the_page_says_where_we_are_worse_first() -> None:
    outcome = ExperimentOutcome(
        "a", "A", "t", verdicts=(Comparison("x", "p", "better"), Comparison("y", "q", "worse"))
    )
    text = comparison_summary([outcome])
    assert text.index("**Worse**") < text.index("**Better**")
    assert "better in 1, equal in 0, worse in 1" in text
    whole = page([outcome], "python -m tests.paper --out a", "", "an introduction")
    assert "Made by `python -m tests.paper --out a`" in whole
    assert comparison_summary([]) == ""


@pytest.mark.slow
def test_ones_own_pattern(tmp_path: Path, picture: Path) -> None:
    words = [
        "--pattern",
        str(picture),
        "--noise",
        "2.1",
        "--burst",
        "4",
        "--quick",
        "--out",
        str(tmp_path / "out"),
    ]
    assert own(*words, "--target", "400") == 0
    text = (tmp_path / "out" / "pattern.md").read_text(encoding="utf-8")
    assert "no independent truth" in text.replace("\n", " ")
    assert "Recommendation" in text
    assert "8 bit" in text
    assert (tmp_path / "out" / "pattern.csv").exists()


@pytest.mark.parametrize(
    ("words", "error", "message"),
    [
        (["--pattern", "none.png"], DataError, "none.png"),
        ([], ConfigError, "give a picture of your pattern, --pattern FILE; in a checkout make paper"),
        (["--pattern", "mine.png", "--noise", "-1"], SystemExit, "2"),
        (["--pattern", "mine.png", "--burst", "0"], SystemExit, "2"),
        (["--pattern", "mine.png", "--target", "0"], SystemExit, "2"),
        (["--pattern", "mine.png", "--roi", "0,0,900,9"], ConfigError, "leaves the picture"),
        (["--pattern", "mine.png", "--roi", "a"], ConfigError, "four whole numbers"),
        (["--pattern", "mine.png", "--roi", "0,0,20,20"], DataError, "too few"),
    ],
)
def test_refusals(
    tmp_path: Path,
    picture: Path,
    monkeypatch: pytest.MonkeyPatch,
    words: list[str],
    error: type[Exception],
    message: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(error, match=message):
        own(*words, "--out", "out")


def test_the_experiments_refuse_what_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="x: not known"):
        command(parsed("--only", "x", "--out", str(tmp_path)))
    with pytest.raises(ConfigError, match="nowhere"):
        command(parsed("--data", "nowhere", "--out", str(tmp_path)))


def test_a_blank_picture_is_refused(tmp_path: Path) -> None:
    import cv2

    cv2.imwrite(str(tmp_path / "blank.png"), np.full((120, 120), 90, np.uint8))
    with pytest.raises(DataError, match="no pattern"):
        own("--pattern", str(tmp_path / "blank.png"), "--quick", "--out", str(tmp_path / "out"))


@pytest.fixture
def session(tmp_path: Path) -> Path:
    camera = replace(CAMERA, width=128, height=96)
    speckle = Speckle((96, 128), 2.0, seed=9)
    path = tmp_path / "run.h5"
    with writer(path, camera, config={"measure": {"zoi": 32, "step": 16}}) as out:
        for number, shift in enumerate((0.0, 0.4)):
            image = np.rint(speckle.fast(Affine(shift, -shift)) * 4095).astype(np.uint16)
            out.write_frame(frame(number, camera, image=frozen(image)))
    return path


def inspected(*words: str) -> argparse.Namespace:
    parser = argparse.ArgumentParser()
    add_inspect(parser)
    return parser.parse_args(words)


def test_inspect_draws_one_zoi(session: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "zoi.png"
    words = [str(session), "--zoi", "1,2", "--frame", "1", "--out", str(out)]
    assert inspect(inspected(*words)) == 0
    printed = capsys.readouterr().out
    assert "ZOI 1,2 (32 px at x 36, y 20)" in printed
    assert "u = 0.3" in printed or "u = 0.4" in printed
    assert out.stat().st_size > 10_000
    with pytest.raises(ConfigError, match="is not overwritten"):
        inspect(inspected(*words))


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--zoi", "9,9", "--frame", "1"], "rows 0 to 3 and columns 0 to 5"),
        (["--zoi", "x", "--frame", "1"], "row,column"),
    ],
)
def test_inspect_refuses(session: Path, tmp_path: Path, words: list[str], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        inspect(inspected(str(session), *words, "--out", str(tmp_path / "new.png")))


def test_the_verdicts_lie_beside_the_figures(tmp_path: Path) -> None:
    outcome = ExperimentOutcome(
        "a", "A", "t", verdicts=(Comparison("x, y", "p", "better"), Comparison("z", "q", "worse"))
    )
    write_page([outcome], tmp_path / "page.md", tmp_path, "python -m tests.paper --out a", "")
    lines = (tmp_path / "verdicts.csv").read_text(encoding="utf-8").splitlines()
    assert lines == ["verdict,ours against the other,the other", "worse,z,q", 'better,"x, y",p']


def test_the_committed_tables_are_those_of_the_page_how_well() -> None:
    docs = Path(__file__).parents[2] / "docs"
    text = " ".join((docs / "how-well.md").read_text(encoding="utf-8").split())
    rows = (docs / "data" / "characterisation" / "verdicts.csv").read_text(encoding="utf-8").splitlines()[1:]
    counts = [sum(row.startswith(f"{word},") for row in rows) for word in ("better", "equal", "worse")]
    assert f"Of {len(rows)} comparisons" in text
    assert "{} are better, {} equal (within 10 %), and {} worse".format(*counts) in text


def test_what_is_not_installed_is_left_out_and_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(others, "find_spec", lambda name: None)
    assert others.installed() == {}
    assert "pip install pyvale sun-dic" in present()
    monkeypatch.setattr(others, "find_spec", lambda name: object() if name == "pyvale" else None)
    assert list(others.installed()) == ["pyvale, 33 px"]
    assert "left out: SUN-DIC" in present()


def test_empty_rim_is_cut_off() -> None:
    u = np.full((5, 6), np.nan)
    u[1:4, 2:5] = 1.0
    u[2, 3] = np.nan
    inner = others._inner(u)
    assert inner.shape == (3, 3)
    assert np.count_nonzero(np.isnan(inner)) == 1


@pytest.mark.slow
@pytest.mark.filterwarnings("default")
@pytest.mark.parametrize(("module", "program"), others.PROGRAMS.values())
def test_a_known_shift(module: str, program: others.Program) -> None:
    if find_spec(module) is None:  # not imported here: pyvale opens a log file wherever that is done
        pytest.skip(f"{module} is not installed")
    from hw_mocks.deformation import Affine
    from tests.paper.truth import SensorModel, TrueScene

    pair = TrueScene((160, 200), 2.25, 3).pair(Affine(0.25), SensorModel(8))
    assert np.nanmean(program(*pair)) == pytest.approx(0.25, abs=5e-3)


@pytest.mark.slow
def test_a_program_that_fails_is_named_and_the_page_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def broken(reference: np.ndarray, deformed: np.ndarray) -> np.ndarray:
        raise AttributeError("no such module")

    monkeypatch.setattr(peers, "installed", lambda: {"pyvale, 33 px": broken})
    monkeypatch.setattr(peers, "SHIFTS", np.array([0.25]))
    outcome = peers.peers(ExperimentContext(tmp_path, quick=True))
    assert "pyvale is installed but failed (AttributeError: no such module)" in outcome.text.replace(
        "\n", " "
    )
    engines = [row[0] for row in outcome.tables[0].rows]
    assert len(engines) == 4
    assert "pyvale, 33 px" not in engines
    assert "pyvale" in caplog.text
