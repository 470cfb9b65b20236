"""``strain.h5`` and ``strain.csv``: written row by row, read back by ``Strain``.

``writer`` waits for the force of a ``row`` and hands it to ``strain_h5`` and ``strain_csv``; ``info`` is
what stands beside the numbers, ``quantities`` says what every number means, ``reader`` opens the file,
``dataset`` makes an xarray of it, ``noise_floor`` finds its still phase; ``python -m live.results``
is a first reading in a child process.
"""

from live.results.dataset import dataset, mean_name
from live.results.info import ResultsInfo
from live.results.noise_floor import StillPhase, still_phase_of
from live.results.quantities import MEANS, UNITLESS, Quantity, quantity_of
from live.results.reader import Strain
from live.results.row import gauge_columns
from live.results.strain_h5 import FLUSH_S
from live.results.writer import Results

__all__ = [
    "FLUSH_S",
    "MEANS",
    "UNITLESS",
    "Quantity",
    "Results",
    "ResultsInfo",
    "StillPhase",
    "Strain",
    "dataset",
    "gauge_columns",
    "mean_name",
    "quantity_of",
    "still_phase_of",
]
