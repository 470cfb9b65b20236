"""What the page shows of a test that has ended."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from analysis.evaluate import TensileFigures
from live.setup import SpecimenConfig
from live.tell import Books, TensileRow, evaluate, headline, sentence, summary_lines


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
    return [_figure(row) for row in headline(figures, stresses=specimen.area_m2 is not None)]


def _figure(row: TensileRow) -> dict[str, Any]:
    if not row.figure.known:
        return {"name": row.name, "text": None, "why": row.figure.why}
    return {"name": row.name, "text": row.text.replace("+-", "±"), "why": ""}
