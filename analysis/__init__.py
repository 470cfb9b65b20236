"""Phase-DIC on arrays: displacement, strain and their uncertainty, ZOI by ZOI.

>>> grid = ZoiGrid.cover(Roi(x, y, width, height), size=64, step=16)
>>> kernel = PhaseKernel(reference, grid)
>>> field = kernel.measure(deformed)
>>> field.mean("exx")

Nothing here knows of files, threads, devices or the clock. Compiled code (numba) is loaded when
the first ``PhaseKernel`` is made; ``warm_up`` does that ahead of a test.
"""

from analysis.phase_kernel import PhaseKernel
from analysis.prepared import PatternError
from analysis.settings import KernelSettings, NoiseModel
from analysis.strain_field import Status, StrainField
from analysis.warm_up import warm_up
from analysis.zoi_grid import Roi, ZoiGrid

__all__ = [
    "KernelSettings",
    "NoiseModel",
    "PatternError",
    "PhaseKernel",
    "Roi",
    "Status",
    "StrainField",
    "ZoiGrid",
    "warm_up",
]
