"""The files of a run: ``strain.h5`` and ``strain.csv`` written row by row, and read back.

``writer`` writes a row in its ``layout`` to ``strain.csv`` and by ``strain_h5``; ``quantities`` defines each
number, ``reader`` opens the file (``Strain``), ``run_folder`` a whole run, ``pictures`` its images. ``figures`` is
the table of tensile figures, ``summary`` the text at the end, ``noise_floor`` the still phase. Packages: ``maps``,
``report``, ``export``. ``python -m live.results`` reads an unfinished file in a child process.
"""

from live.results.layout import ResultsInfo, gauge_columns
from live.results.quantities import MEANS, UNITLESS, Display, Quantity, mean_name, quantity_of
from live.results.reader import Strain
from live.results.report.evaluation import StillPhase, still_phase_of
from live.results.strain_h5 import FLUSH_S
from live.results.writer import Results

__all__ = [
    "FLUSH_S",
    "MEANS",
    "UNITLESS",
    "Display",
    "Quantity",
    "Results",
    "ResultsInfo",
    "StillPhase",
    "Strain",
    "gauge_columns",
    "mean_name",
    "quantity_of",
    "still_phase_of",
]
