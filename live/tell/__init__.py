"""What is told to a person and kept for the record.

``books`` holds what is kept of a test: ``journal`` has every event, ``ledger`` the fate of every frame,
``screen`` the terminal, ``card`` the status in the view, ``summary`` the figures at the end.
"""

from live.tell.books import Books
from live.tell.card import StatusCard
from live.tell.journal import Journal
from live.tell.ledger import Ledger
from live.tell.screen import Screen
from live.tell.summary import elastic_lines, evaluate, file_lines, quantity, summary_lines

__all__ = [
    "Books",
    "Journal",
    "Ledger",
    "Screen",
    "StatusCard",
    "elastic_lines",
    "evaluate",
    "file_lines",
    "quantity",
    "summary_lines",
]
