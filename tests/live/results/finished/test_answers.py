"""What summary and report answer: can the figures be believed, what is missing, what to type for it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from live.config.sections import SpecimenConfig
from live.results.finished.figures_file import MeasuredAgain, checks_line, missing_lines
from live.results.finished.findings import findings
from live.results.finished.finished_test import FinishedTest
from live.results.report.report import ReportRequest, make_report
from live.results.run_folder import open_run
from live.ui.terminal.screen import TerminalScreen
from live.ui.terminal.summary import print_summary, trouble_lines
from tests.live.made_run import PULLED, finished, make_run
from tests.live.results.finished.test_findings import STRAINS, stress_of
from tests.live.results.finished.test_findings import test_of as made
from tests.live.screens import RecordingScreen
from tests.live.ui.terminal.test_summary import run_of

AGAIN = MeasuredAgain("phasedic replay R", 4.0)


def missing(test: FinishedTest, again: MeasuredAgain = AGAIN) -> list[str]:
    return [line.removeprefix("missing: ") for line in missing_lines(test, again)]


def few_points() -> FinishedTest:
    return made(np.r_[0, np.linspace(0, 0.02, 12)])


def test_each_thing_that_is_missing_has_what_to_type() -> None:
    assert missing(made()) == []
    assert missing(finished(run_of(PULLED, loads=False))) == [
        "forces, for E: phasedic replay R --load FORCES.csv"
    ]
    bare = SpecimenConfig(axis="y")
    assert missing(finished(run_of(PULLED, bare, loads=False))) == [
        "forces, for E: phasedic replay R --load FORCES.csv --section W,T"
    ]
    assert missing(made(specimen=bare)) == [
        "the section in mm, for E in GPa: phasedic replay R --section W,T"
    ]
    late = made(times=[1000 + k / 10 for k in range(len(STRAINS))])
    assert not late.has_force and missing(late) == [
        "forces at the time of the pictures, for E: phasedic replay R --load FORCES.csv --lag S"
    ]
    assert not few_points().figures.E.known
    assert missing(few_points()) == [
        "points while the force rises, for E: phasedic replay R --burst 1 gives 4 times as many"
    ]
    single = replace(AGAIN, n_frames=1.0)
    assert "take more pictures" in missing(few_points(), single)[0]
    assert "a force that changes" in missing(made(force=np.full(len(STRAINS), 3.0)))[0]
    skipped = replace(AGAIN, skipped=40)
    assert missing(made(), skipped) == [
        "40 frames came too fast to be measured: phasedic replay R measures them"
    ]


def test_what_is_no_tensile_test_misses_nothing() -> None:
    cycles = made(np.concatenate([0.001 * np.sin(np.linspace(0, 20, 200))]))
    assert cycles.figures.kind != "tensile" and missing(cycles) == []


def test_a_recording_is_named_and_one_that_is_not_there_is_not(tmp_path: Path) -> None:
    assert MeasuredAgain.of(tmp_path, 4.0, 8) == MeasuredAgain("the same command with", 4.0, 0)
    (tmp_path / "session.h5").touch()
    assert MeasuredAgain.of(tmp_path, 4.0, 8) == MeasuredAgain(f"phasedic replay {tmp_path}", 4.0, 8)


def test_the_checks_that_were_made_stand_in_one_line() -> None:
    good = findings(made())
    assert {one.outcome for one in good} == {"good", "not checked"} or all(x.outcome == "good" for x in good)
    words = checks_line(good)
    assert words.startswith("checks of the data: sign of the force, ") and "in doubt" not in words
    for one in good:
        part = next(part for part in words.split("; ") if one.name in part)
        assert part.endswith("good" if one.outcome == "good" else "not possible")
    turned = checks_line(findings(made(-STRAINS, force=stress_of(STRAINS) * 20e-6)))
    assert "; sign of the force" in turned and "in doubt" in turned
    without = checks_line(findings(finished(run_of(PULLED, loads=False))))
    assert without.endswith("; 8 that need a force not possible")


def test_a_bad_test_has_its_answers_in_twelve_lines_in_the_order_in_which_they_are_asked(
    tmp_path: Path,
) -> None:
    run_state, screen = run_of(PULLED[::9]), RecordingScreen()
    run_state.frame_counts.add(skipped=40)
    (tmp_path / "session.h5").write_bytes(b"x")
    test = finished(run_state, reference_N=500.0)
    assert not test.figures.E.known
    print_summary(screen, run_state, test, tmp_path, [*trouble_lines(run_state, ())])
    begins = ["", "measured ", "strain along y", "noise: ", "checks of the data", "look: the reference",
              "E is not known: ", "Rm = ", "missing: points", "missing: 40 frames", "grabbed ", "files: "]  # fmt: skip
    assert len(screen.lines) == len(begins)
    assert all(map(str.startswith, screen.lines, begins)), screen.lines


def test_the_report_answers_in_the_same_order(tmp_path: Path) -> None:
    with open_run(make_run(tmp_path / "run", PULLED[::9])) as run:
        report = make_report(run, ReportRequest(), TerminalScreen(quiet=True))
        assert report.test is not None
        lines = [
            checks_line(findings(report.test)),
            "E is not known: ",
            "missing: points",
            "Specimen and rig",
        ]
    places = [report.html.find(line) for line in lines]
    assert -1 not in places and places == sorted(places)
    with open_run(make_run(tmp_path / "whole")) as run:
        whole = make_report(run, ReportRequest(), TerminalScreen(quiet=True)).html
    assert "missing: " not in whole and 0 < whole.index("checks of the data") < whole.index("GPa")
