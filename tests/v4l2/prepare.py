"""What is better done outside the emulated machine: render pictures, compile for its processor.

``python -m tests.v4l2.prepare FOLDER`` writes ``pictures.npz``; with NUMBA_CACHE_DIR and
NUMBA_CPU_NAME set as for the machine, its compiled loops are ready when it boots.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tests.accuracy.truth import Speckle, affine, digitise

SHAPE = (480, 640)
MEASURED = ("--zoi", "64", "--step", "64", "--burst", "2", "--reference-burst", "2", "--roi", "all")
SHIFT_PX = {"u": 0.37, "v": -0.21}
STRAIN = {"du_dx": -3e-4, "dv_dy": 1e-3}


def picture(bits: int, **motion: float) -> NDArray[np.uint8] | NDArray[np.uint16]:
    """A speckle picture, radius 2 px, of known motion."""
    image: NDArray[np.uint8] | NDArray[np.uint16] = digitise(
        Speckle(2.0, 3, span=500).at(*affine(SHAPE, **motion)), bits
    )
    return image


def pictures() -> dict[str, NDArray[np.uint8] | NDArray[np.uint16]]:
    """Reference, shifted and strained, in 8 and 12 bits."""
    motions = {"reference": {}, "shifted": SHIFT_PX, "strained": STRAIN}
    return {f"{name}_{bits}": picture(bits, **motion) for name, motion in motions.items() for bits in (8, 12)}


def compile_loops() -> None:
    """Every loop a run needs, for both sample types, by a small run of the measuring path."""
    from acquire.burst.accumulate import burst_of
    from acquire.frame import Frame, frozen
    from acquire.hdf5 import compile_loops as compile_recording
    from analysis import KernelSettings, PhaseKernel, Roi, ZoiGrid
    from analysis.kernel.warm_up import warm_up

    warm_up()
    compile_recording()
    grid = ZoiGrid.cover(Roi(0, 0, 640, 480), size=64, step=64)
    for bits in (8, 12):
        image = frozen(picture(bits))
        burst = burst_of([Frame(image, k, k / 10, "device", 0, bits, k / 10) for k in range(2)])
        kernel = PhaseKernel(burst.mean, grid, KernelSettings(), noise=0.3)
        field = kernel.measure(burst.mean, noise=0.3, clipped=burst.clipped)
        kernel.measure(burst.mean, start=field, noise=0.3)


if __name__ == "__main__":
    np.savez(Path(sys.argv[1]) / "pictures.npz", **pictures())  # type: ignore[arg-type]
    compile_loops()
