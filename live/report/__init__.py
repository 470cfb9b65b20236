"""The report of a finished run, or of several: one HTML file that asks nothing of anybody.

``report`` puts it together from ``evaluation`` (figures, instants, still phase, noise floor), ``curves``, ``maps``,
``practice`` (the table of the iDICs guide) and ``record`` (ledger, events, hashes); ``comparison`` has several
tests; ``svg`` draws, ``page`` writes HTML and escapes, ``browser`` prints, ``saving`` makes the files.
"""

from live.report.browser import NO_BROWSER, find_browser
from live.report.comparison import compare, tests_of, write_table
from live.report.report import Report, Wanted, make_report
from live.report.saving import save_figures, save_page, save_pdf
from live.report.svg import Curve as Line
from live.report.svg import Figure

__all__ = [
    "NO_BROWSER",
    "Figure",
    "Line",
    "Report",
    "Wanted",
    "compare",
    "find_browser",
    "make_report",
    "save_figures",
    "save_page",
    "save_pdf",
    "tests_of",
    "write_table",
]
