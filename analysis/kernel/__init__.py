"""One reference, and any number of pictures measured against it.

``phase_kernel`` is the face to all else: it holds a ``reference`` (``prepared`` ZOI by ZOI, ``quadrature``
for the paper's estimator) and measures by an ``attempt``, ``rescue`` and ``result``. ``settings``,
``noise`` and ``images`` are what goes in; ``warm_up`` compiles everything ahead.
"""

from analysis.kernel.noise import NoiseModel
from analysis.kernel.phase_kernel import PhaseKernel, check_machine
from analysis.kernel.prepared import PatternError
from analysis.kernel.settings import Estimator, KernelSettings
from analysis.kernel.warm_up import COMPILE_PARTS, PICTURE_KINDS, not_compiled, numerics, threads, warm_up

__all__ = [
    "COMPILE_PARTS",
    "PICTURE_KINDS",
    "Estimator",
    "KernelSettings",
    "NoiseModel",
    "PatternError",
    "PhaseKernel",
    "check_machine",
    "not_compiled",
    "numerics",
    "threads",
    "warm_up",
]
