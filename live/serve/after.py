"""What the page shows of a test that has ended."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from analysis.evaluate import Figure, TensileFigures
from live.setup import SpecimenConfig
from live.tell import Books, evaluate, interval, sentence, summary_lines

_PLAIN = (("nu", "nu", 1.0, ""),)
_STRESSES = (("E", "E", 1e9, "GPa"), ("Rp0.2", "Rp02", 1e6, "MPa"), ("Rm", "Rm", 1e6, "MPa"))
_FORCES = (("EA", "E", 1e3, "kN"), ("Fp0.2", "Rp02", 1.0, "N"), ("Fm", "Rm", 1.0, "N"))


def ended(books: Books, specimen: SpecimenConfig, folder: Path, words: str) -> dict[str, Any]:
    """Figures, summary, ledger and losses; ``words`` say how the run ended, empty where it ended well."""
    figures = evaluate(books.history, books.loads, specimen) if books.history.instants else None
    troubles = books.journal.events("warning", "error")
    return {
        "folder": str(folder),
        "words": words,
        "figures": [] if figures is None else _figures(figures, specimen),
        "lines": [line.strip() for line in summary_lines(books, specimen)],
        "ledger": books.ledger.line(),
        "troubles": [sentence(event, books.journal.names) for event in troubles[-5:]],
    }


def _figures(figures: TensileFigures, specimen: SpecimenConfig) -> list[dict[str, Any]]:
    known = _FORCES if specimen.area_m2 is None else _STRESSES
    ordered = (known[0], *_PLAIN, *known[1:])
    return [_figure(name, getattr(figures, key), unit_is, unit) for name, key, unit_is, unit in ordered]


def _figure(name: str, figure: Figure, unit_is: float, unit: str) -> dict[str, Any]:
    if not figure.known:
        return {"name": name, "text": None, "why": figure.why}
    return {"name": name, "text": interval(figure, unit_is, unit).replace("+-", "±"), "why": ""}
