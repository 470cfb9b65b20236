"""``strain.h5`` and ``strain.csv``: written row by row, read back by ``Strain``.

``writer`` waits for the force of a ``row`` and hands it to ``strain_h5`` and ``strain_csv``; ``info`` is
what stands beside the numbers, ``reader`` opens the file; ``python -m live.results`` is a first reading in
a child process.
"""

from live.results.info import ResultsInfo
from live.results.reader import Strain
from live.results.row import gauge_columns
from live.results.writer import Results

__all__ = ["Results", "ResultsInfo", "Strain", "gauge_columns"]
