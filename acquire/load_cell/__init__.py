"""What a load cell is, and the load against time.

``contract`` says what every load cell promises, ``load_log`` gives the force at a time, ``check`` judges rate,
noise and gaps, ``stillness`` tells noise from movement, ``calibration`` makes newtons of readings, ``none`` is
the absent one, ``opening`` finds the load cell that an address names.
"""

from acquire.load_cell import calibration, check
from acquire.load_cell.calibration import Calibration
from acquire.load_cell.calibration import load as load_calibration
from acquire.load_cell.contract import LoadCell
from acquire.load_cell.load_log import LoadLog
from acquire.load_cell.opening import LOAD_CELLS, open_load_cell
from acquire.load_cell.stillness import Stillness, stillness

__all__ = [
    "LOAD_CELLS",
    "Calibration",
    "LoadCell",
    "LoadLog",
    "Stillness",
    "calibration",
    "check",
    "load_calibration",
    "open_load_cell",
    "stillness",
]
