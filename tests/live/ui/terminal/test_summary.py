"""The summary of a test: at most a dozen lines, each of which a person needs; the rest with --verbose."""

from __future__ import annotations

import io
import math
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from acquire.events import EventKind
from acquire.load_sample import LoadSample
from live.config.sections import SpecimenConfig
from live.pipeline.consumer import ConsumerReport
from live.pipeline.measurement import Measurement
from live.pipeline.run_state import RunState
from live.results.finished.figures_file import MeasuredAgain, missing_lines
from live.results.summary import summary_lines
from live.ui.terminal.screen import TerminalScreen
from live.ui.terminal.summary import brief_lines, print_summary, trouble_lines
from live.words.language import LANGUAGES
from tests.live.made_run import PULLED, finished, force_of
from tests.live.made_up import in_ascii, make_measurement
from tests.live.screens import RecordingScreen

SECTION = SpecimenConfig(width_mm=10.0, thickness_mm=2.0, axis="y")


def lines_of(run_state: RunState) -> list[str]:
    return brief_lines(run_state, finished(run_state))


def run_of(strains: Sequence[float], specimen: SpecimenConfig = SECTION, *, loads: bool = True) -> RunState:
    run_state = RunState.new(0.5, specimen=specimen, with_load=loads)
    for k, strain in enumerate(strains):
        force = force_of(strain) if loads else math.nan
        measurement: Measurement = make_measurement(k, strain, force=force)
        run_state.history.add(measurement.time_step)
        run_state.frame_counts.add(grabbed=8, measured=8, recorded=8)
        if loads:
            run_state.loads.append(LoadSample(measurement.t, force))
    run_state.loads.close()
    return run_state


def test_another_measure_of_strain_is_named() -> None:
    run_state = run_of(PULLED)
    test = finished(run_state)
    plain, green = (
        brief_lines(run_state, replace(test, measure=name))[1] for name in ("engineering", "green")
    )
    assert green == f"{plain} (measure of strain: green)"


def test_what_a_test_gave_in_a_dozen_lines(tmp_path: Path) -> None:
    run_state, screen = run_of(PULLED), RecordingScreen()
    (tmp_path / "strain.h5").write_bytes(bytes(2_000_000))
    print_summary(screen, run_state, finished(run_state), tmp_path, [*trouble_lines(run_state, ())])
    text = "\n".join(screen.lines)
    assert len(screen.lines) <= 12
    assert re.search(r"^E = (70\.0|69\.9|70)\d* ± (< )?[\d.]+ GPa  nu = 0\.[23]", text, re.MULTILINE), text
    assert "Rp0.2 = " in text and "Rm = " in text
    assert "strain along y at the end: 8000.0 +- " in in_ascii(text) and "µm/m" in text
    assert "noise: " in text and "every frame is accounted for" in text
    assert f"files: {tmp_path} (strain.h5; 2.0 MB); next: phasedic report {tmp_path}" in text
    assert "--lag" not in text and "um/m" not in text


def test_verbose_has_all(tmp_path: Path) -> None:
    run_state, screen = run_of(PULLED), RecordingScreen()
    print_summary(screen, run_state, finished(run_state), tmp_path, [], verbose=True)
    text = "\n".join(screen.lines)
    assert "last strain of the region: exx" in text and "lag of the load behind the frames" in text


@pytest.mark.parametrize(
    ("strains", "loads", "why"),
    [
        (PULLED, False, "no force is known"),
        (
            (0.0, 1e-5, 2e-5),
            True,
            "3 measurements in all, 8 are needed: more pictures",
        ),
        (
            (0.0, 1e-5, 2e-5, *[math.nan] * 7),
            True,
            "only 3 measurements with strain and a tensile force, 8 are needed",
        ),
    ],
)
def test_why_there_is_no_modulus(strains: Sequence[float], loads: bool, why: str) -> None:
    assert any(line.startswith(f"E is not known: {why}") for line in lines_of(run_of(strains, loads=loads)))


def test_nothing_measured_is_the_only_line() -> None:
    assert lines_of(RunState.new(0.5)) == [
        "nothing was measured: 0 frames gave no burst after the reference; take shorter bursts"
    ]


@pytest.mark.parametrize(("degrees", "shown"), [(4.0, False), (6.0, True), (-6.0, True)])
def test_a_load_that_is_more_than_five_degrees_off_its_axis_is_told(degrees: float, shown: bool) -> None:
    """Tension along y, turned: tensor components of the strains 2e-3 and -6e-4."""
    turn, run_state = math.radians(degrees), RunState.new(0.5, specimen=SpecimenConfig(axis="y"))
    cos, sin = math.cos(turn), math.sin(turn)
    exx, eyy = 2e-3 * sin**2 - 6e-4 * cos**2, 2e-3 * cos**2 - 6e-4 * sin**2
    for k in range(10):
        share, m = k / 9, make_measurement(k)
        strains = {"exx": share * exx, "eyy": share * eyy, "exy": share * 2.6e-3 * sin * cos}
        run_state.history.add(replace(m.time_step, **strains, sigma_exx=1e-6, sigma_eyy=1e-6, sigma_exy=1e-6))
    lines = [line for line in lines_of(run_state) if "largest strain" in line]
    assert len(lines) == shown
    assert not shown or f"largest strain {-degrees:g} degrees off y (clockwise)" in in_ascii(lines[0])


def without_values(run_state: RunState, *numbers: int) -> RunState:
    """The same run, whose time steps of these numbers have no value at all."""
    changed = RunState.new(0.5, specimen=SECTION)
    for k, step in enumerate(run_state.history.time_steps):
        nothing = dict.fromkeys(("exx", "eyy", "exy", "sigma_eyy"), math.nan) | {
            "n_valid": 0,
            "gauges": {},
        }
        changed.history.add(replace(step, **nothing, refused="9 LOST") if k in numbers else step)
    return changed


def test_the_end_is_that_of_the_last_burst() -> None:
    strains = (0.0, 1e-3, 2e-3, 3e-3)
    whole = run_of(strains, SpecimenConfig(axis="y"), loads=False)
    for step in whole.history.time_steps:
        assert step.n_valid > 0
    torn = without_values(whole, 2, 3)
    assert whole.history.ends_with_values and not torn.history.ends_with_values and torn.history.has_values
    n_zoi = torn.history.time_steps[-1].n_zoi
    lines = brief_lines(torn, finished(torn))
    assert lines[0] == f"measured 4 bursts, 0 of {n_zoi} ZOIs valid in the last (9 LOST)"
    assert lines[1] == f"strain along y at the end: no value, 0 of {n_zoi} valid (9 LOST)"
    assert in_ascii(lines[2]).startswith("the last burst with a value is 2 of 4: 1000.0 +- ")
    assert any(
        f"last strain of the region: no value, 0 of {n_zoi} ZOIs valid" in x
        for x in summary_lines(torn, finished(torn))
    )
    back = without_values(whole, 1, 2)
    found_again = brief_lines(back, finished(back))
    assert in_ascii(found_again[1]).startswith("strain along y at the end: 3000.0 +- ")


def all_wrong() -> RunState:
    """A film that is pressed, with wrong signs, lost frames and bursts, dead outputs; torn at the end."""
    specimen = SpecimenConfig(film_error_percent=10.0)
    state = without_values(run_of([-e for e in PULLED[:60]], SpecimenConfig(axis="y")), 58, 59)
    whole = RunState.new(0.5, specimen=specimen)
    for step in state.history.time_steps:
        whole.add(replace(step, exx=2 * step.exx, exy=step.eyy / 3))
    for k, step in enumerate(state.history.time_steps):
        force = abs(force_of(step.eyy)) if k < 50 else math.nan
        whole.loads.append(LoadSample(step.t + 0.35, force))
    whole.loads.close()
    whole.frame_counts.add(grabbed=600, recorded=470, measured=300, skipped=90, lost=30)
    for k in range(3):
        whole.event_log.emit(EventKind.DEVICE, "camera", f"frame {k} is damaged", "warning")
        whole.event_log.emit(EventKind.ALARM, "alarm", f"alarm {k} is on", "error")
    return whole


def test_where_everything_goes_wrong_a_dozen_lines_say_the_most_and_count_the_rest(tmp_path: Path) -> None:
    state, screen = all_wrong(), RecordingScreen()
    reports = [ConsumerReport(f"output {k}", failed="a full disk") for k in range(4)]
    (tmp_path / "session.h5").write_bytes(b"x")
    test, troubles = finished(state, reference_N=500.0), [*trouble_lines(state, reports)]
    print_summary(screen, state, test, tmp_path, troubles)
    again = MeasuredAgain.of(tmp_path, 5.0, 90)
    every = [*brief_lines(state, test), *missing_lines(test, again), *troubles]
    looks = [line for line in every if line.startswith("look: ")]
    assert len(every) >= 16 and len(looks) == 3
    assert len(screen.lines) == 12
    assert screen.lines[-2] == f"{len(every) - 9} more remarks: report.html"
    shown = screen.lines[1:-2]
    assert len(shown) == 9 and [line for line in every if line in shown] == shown
    assert {*every[:2], *looks, troubles[0]} <= {*shown}
    assert any(line.startswith("E is not known: ") for line in shown)
    assert not any(line.startswith(("noise: ", "  output")) for line in shown)


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("loads", [True, False])
def test_the_summary_in_another_language(
    language: str, loads: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No line of it stays English, and its decimal mark is the comma."""
    monkeypatch.setenv("LC_ALL", f"{language}_XX.UTF-8")
    run_state, out = run_of(PULLED, loads=loads), io.StringIO()
    (tmp_path / "strain.h5").write_bytes(bytes(2_000_000))
    test, troubles = finished(run_state), [*trouble_lines(run_state, ())]
    for verbose in (False, True):
        print_summary(TerminalScreen(out), run_state, test, tmp_path, troubles, verbose=verbose)
    text = out.getvalue().replace(str(tmp_path), "FOLDER")
    assert not re.search(r"\b(the|of|is|are|and|with|missing|not known|along|to)\b", text), text
    assert not re.search(r"\d\.\d", text.replace("Rp0.", "").replace("Rp0.2", "")), text
    assert ("Prüfungen der Daten: " if language == "de" else "contrôles des données : ") in text
