"""What is measured, on a grid: arrays with their uncertainty.

``grid`` lays the ZOIs, ``windows`` weigh their pixels, ``strain_field`` is the result with its ``status``,
the strain ``tensor`` and the ``uncertainty`` of values and means; ``motion`` is what one field says of the
next.
"""

from analysis.field.grid import Roi, ZoiGrid
from analysis.field.motion import Motion
from analysis.field.status import Status
from analysis.field.strain_field import StrainField
from analysis.field.tensor import Measure, StrainTensor
from analysis.field.uncertainty import PAIR_INDEX, VALUES, combination, products, variance_of_sum
from analysis.field.windows import WINDOWS, Window, profile

__all__ = [
    "PAIR_INDEX",
    "VALUES",
    "WINDOWS",
    "Measure",
    "Motion",
    "Roi",
    "Status",
    "StrainField",
    "StrainTensor",
    "Window",
    "ZoiGrid",
    "combination",
    "products",
    "profile",
    "variance_of_sum",
]
