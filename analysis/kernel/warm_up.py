"""Compile everything ahead of a test, so that nothing compiles during it."""

from __future__ import annotations

import logging

import numpy as np

log = logging.getLogger("analysis")

COMPILE_SECONDS = 80
"""About how long the first compilation takes; said in the announcement."""


def warm_up() -> None:
    """Compile, or load from numba's cache, every loop that a kernel can need.

    The first time on a machine this takes a minute or two and says so in the log.
    """
    from analysis.field import Roi, ZoiGrid
    from analysis.kernel.noise import NoiseModel
    from analysis.kernel.phase_kernel import PhaseKernel
    from analysis.kernel.settings import KernelSettings

    announce()
    y, x = np.mgrid[:96, :96].astype(np.float32)
    image = 100 + 40 * np.sin(x * 1.3 + 0.2 * y) * np.cos(0.9 * y - 0.35 * x)
    grid = ZoiGrid.cover(Roi(8, 8, 80, 80), size=32, step=16)
    for settings in (KernelSettings(), KernelSettings(order=2), KernelSettings(estimator="phase")):
        kernel = PhaseKernel(image, grid, settings, NoiseModel(0.1, 1.0))
        field = kernel.measure(image)
        kernel.measure(image, start=field)
    for kind in (np.uint8, np.uint16):
        kernel.measure(image.astype(kind), start=field)


def announce() -> None:
    """Say in the log that compilation is about to happen, where it is."""
    from analysis.compiled.loops import is_cached
    from analysis.fit import iteration, sensitivity
    from analysis.follow import climb
    from analysis.picture import prefilter

    loops = (prefilter.coefficients, sensitivity.prepare, iteration.track, climb.climb)
    if not all(map(is_cached, loops)):
        log.info("compiling the kernel for this machine, once, about %d s", COMPILE_SECONDS)
