"""Phase-DIC on arrays: displacement, strain and their uncertainty, ZOI by ZOI.

>>> grid = ZoiGrid.cover(Roi(x, y, width, height), size=64, step=16)
>>> kernel = PhaseKernel(reference, grid)
>>> field = kernel.measure(deformed)
>>> field.mean("exx")

This package uses no files, threads, devices or clock. Compiled code (numba) is loaded when the first
``PhaseKernel`` is made; ``warm_up`` does that ahead of a test. The first kernel of a process measures a
known pattern first, and a machine that measures it wrong is refused (``MachineError``).
"""

from analysis.field import Roi, Status, StrainField, ZoiGrid
from analysis.kernel.images import NoiseModel
from analysis.kernel.phase_kernel import PhaseKernel, check_machine
from analysis.kernel.prepared import PatternError
from analysis.kernel.settings import Estimator, KernelSettings
from analysis.kernel.warm_up import (
    COMPILE_PARTS,
    PICTURE_KINDS,
    not_compiled,
    numerics,
    share_compiled,
    threading_library,
    threads,
    warm_up,
)
from analysis.self_test import MachineError

__all__ = [
    "COMPILE_PARTS",
    "PICTURE_KINDS",
    "Estimator",
    "KernelSettings",
    "MachineError",
    "NoiseModel",
    "PatternError",
    "PhaseKernel",
    "Roi",
    "Status",
    "StrainField",
    "ZoiGrid",
    "check_machine",
    "not_compiled",
    "numerics",
    "share_compiled",
    "threading_library",
    "threads",
    "warm_up",
]
