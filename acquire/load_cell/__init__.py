"""What a load cell is, and the force over time.

``contract`` is the contract of load cells, opens an address, and counts forces from a zero, ``load_log`` gives the
force at a time, ``check`` judges rate, noise and gaps, ``calibration`` converts readings to newtons.
"""

from acquire.load_cell import calibration, check
from acquire.load_cell.calibration import Calibration
from acquire.load_cell.calibration import load as load_calibration
from acquire.load_cell.check import LoadStillness, stillness
from acquire.load_cell.contract import LOAD_CELLS, LoadCell, ZeroedLoadCell, open_load_cell
from acquire.load_cell.load_log import LoadLog

__all__ = [
    "LOAD_CELLS",
    "Calibration",
    "LoadCell",
    "LoadLog",
    "LoadStillness",
    "ZeroedLoadCell",
    "calibration",
    "check",
    "load_calibration",
    "open_load_cell",
    "stillness",
]
