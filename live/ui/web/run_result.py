"""The result of a run as the page shows it: warnings, figures, and the straight lines of the evaluation."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from acquire.text import Message, about, joined, word
from analysis.evaluate import TensileFigures
from live.config.sections import SpecimenConfig
from live.pipeline.event_log import sentence
from live.pipeline.run_state import RunState
from live.results.figures import TensileRow, beyond_scatter, headline, tensile_table
from live.results.finished.cycles import creep_lines, shown_figures
from live.results.finished.figures_file import belief
from live.results.finished.findings import doubts, findings
from live.results.finished.finished_test import FinishedTest
from live.results.report.curves import load_unit, strain_unit, stress_strain
from live.results.report.evaluation import EvaluatedCurve, intercept_of
from live.results.summary import why_nothing
from live.run.outcome import Outcome
from live.ui.web.page_consumer import PageConsumer
from live.ui.web.run_panels import figures_of

MAX_TROUBLES = 20


def result_of(cameras: Mapping[str, Outcome], folder: Path, words: str) -> dict[str, Any]:
    """The result of a test, by its cameras; parameters as of ``run_result``."""
    states = {name: one.run_state for name, one in cameras.items()}
    tests = {name: one.test for name, one in cameras.items()}
    if len(cameras) > 1:
        return cameras_result(states, tests, folder, words)
    (name,) = cameras
    return run_result(states[name], tests[name], folder, words)


def run_result(run_state: RunState, test: FinishedTest, folder: Path, words: str) -> dict[str, Any]:
    """What the data say against the figures, warnings, figures, lines over the curve, and frame counts of a run.

    ``words`` describe how the run ended; they are empty where it ended well.
    """
    log, measured, specimen = run_state.event_log, run_state.history.has_values, test.specimen
    troubles = doubts(findings(test)) if measured else []
    troubles += [sentence(event, log.names) for event in log.events("warning", "error")][-MAX_TROUBLES:]
    figures = test.figures if measured else None
    lines = creep_lines(test.creep, stresses=specimen.area_m2 is not None)
    creep = [{"name": Message("creep"), "text": line, "words": True} for line in lines]
    return {
        "folder": str(folder),
        "words": words,
        "figures": []
        if figures is None
        else [*_figures(figures, specimen), *shown_figures(test.cycles), *creep],
        "belief": None if figures is None else _belief(figures, specimen, troubles),
        "lines": [] if figures is None else list(_lines(run_state, specimen, figures)),
        "ledger": run_state.frame_counts.line(),
        "troubles": troubles if measured else [*troubles, why_nothing(run_state)],
    }


def cameras_result(
    states: Mapping[str, RunState], tests: Mapping[str, FinishedTest], folder: Path, words: str
) -> dict[str, Any]:
    """The result of a test with several cameras: figures of the mean and of each, warnings of all, else the first."""
    results = {side: run_result(state, tests[side], folder / side, words) for side, state in states.items()}
    specimen = next(iter(tests.values())).specimen
    found = figures_of(states, specimen)
    troubles = [about(word(side), text) for side, one in results.items() for text in one["troubles"]]
    first = next(iter(found), "")
    stresses = specimen.area_m2 is not None
    figures: list[dict[str, Any]] = [
        {**_figure(row), "side": where, "head": where == first}
        for where, one in found.items()
        for row in headline(one, stresses=stresses)
        if row.figure.known
    ]
    figures += [_interval_of_e(one) for one in list(found.values())[:1] if one.E.known]
    return {
        **next(iter(results.values())),
        "folder": str(folder),
        "figures": figures,
        "belief": _belief(found[first], specimen, troubles) if found else None,
        "troubles": troubles,
    }


def peaks(consumers: Mapping[str, PageConsumer]) -> dict[str, Any]:
    """The maps and gauges at the highest force: those of the first camera, and of each where there are several."""
    found = [{**consumer.at_peak(), "side": name} for name, consumer in consumers.items()]
    if len(found) < 2:
        return found[0] if found else {}
    gauges = [{**gauge, "side": one["side"]} for one in found for gauge in one["gauges"]]
    return {**found[0], "gauges": gauges, "cameras": found}


def _belief(figures: TensileFigures, specimen: SpecimenConfig, troubles: Sequence[str]) -> dict[str, Any]:
    rows = headline(figures, stresses=specimen.area_m2 is not None)
    return asdict(belief(rows, troubles, beyond_scatter(figures)))


def _figures(figures: TensileFigures, specimen: SpecimenConfig) -> list[dict[str, Any]]:
    first = {row.name for row in headline(figures, stresses=specimen.area_m2 is not None)}
    found = [_figure(row) | {"head": row.name in first} for row in _rows(figures, specimen)]
    if figures.E.known and figures.elastic_strain:
        found.append({"name": Message("strain of E and nu"), "text": figures.elastic_strain, "words": True})
    if figures.E.known:
        found.append(_interval_of_e(figures))
    return found + [{"name": Message("of the test"), "text": note, "words": True} for note in figures.notes]


def _interval_of_e(figures: TensileFigures) -> dict[str, Any]:
    parts = (
        figures.budget
        if len(figures.budget) > 1
        else (Message("scatter"), Message("no limits of error are stated"))
    )
    text = joined("; ", parts)
    return {"name": Message("interval of E"), "text": text, "words": True}


def _rows(figures: TensileFigures, specimen: SpecimenConfig) -> list[TensileRow]:
    """All figures of the standard."""
    rows = tensile_table(figures, stresses=specimen.area_m2 is not None).values()
    return [row for row in rows if row.figure.known or row.figure.applies]


def _figure(row: TensileRow) -> dict[str, Any]:
    if not row.figure.known:
        return {"name": row.name, "text": None, "why": row.figure.why}
    return {"name": row.name, "text": row.quantity, "bound": row.figure.is_bound, "remark": row.remark}


def _lines(
    run_state: RunState, specimen: SpecimenConfig, figures: TensileFigures
) -> Iterator[dict[str, Any]]:
    """The lines and marks of the report's curve, in SI units."""
    history, loads = run_state.history, run_state.loads
    axial, transverse = history.along(specimen.axis)
    load = specimen.load(history.forces(loads))
    if not np.isfinite(load).any():
        return
    curve = EvaluatedCurve(
        axial, transverse, load, specimen.area_m2 is not None, figures, intercept_of(axial, load, figures)
    )
    plot, e, unit = stress_strain(curve), strain_unit(axial), load_unit(curve)
    for line in plot.curves[1:]:
        points = zip(line.x / e.factor, line.y / unit.factor, strict=True)
        yield {"points": [(float(x), float(y)) for x, y in points]}
    for mark in plot.marks:
        value = mark.y / unit.factor
        words = {"name": mark.name, "value": value, "bound": mark.is_bound}
        yield {"points": [(mark.x / e.factor, value)], "words": words}
