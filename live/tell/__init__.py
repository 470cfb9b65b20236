"""What is told to a person and kept for the record.

``books`` holds what is kept of a test: ``journal`` has every event, ``ledger`` the fate of every frame,
``board`` the alarms that are on, ``screen`` the terminal, ``status_line`` its last line, ``card`` the status in
the view, ``tensile_table`` the figures of a tensile test with their units, ``figures`` all of them in words,
``summary`` all that is said at the end.
"""

from live.tell.board import AlarmBoard, Vitals
from live.tell.books import Books
from live.tell.card import StatusCard
from live.tell.figures import axis_words, elastic_lines, evaluate, figure_lines, options_of
from live.tell.journal import Journal, sentence
from live.tell.ledger import Ledger
from live.tell.screen import TerminalScreen, say
from live.tell.summary import file_lines, summary_lines
from live.tell.tensile_table import TensileRow, headline, interval, quantity, tensile_table

__all__ = [
    "AlarmBoard",
    "Books",
    "Journal",
    "Ledger",
    "StatusCard",
    "TensileRow",
    "TerminalScreen",
    "Vitals",
    "axis_words",
    "elastic_lines",
    "evaluate",
    "figure_lines",
    "file_lines",
    "headline",
    "interval",
    "options_of",
    "quantity",
    "say",
    "sentence",
    "summary_lines",
    "tensile_table",
]
