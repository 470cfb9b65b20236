"""``python -m tests.accuracy.clutter``: real pictures without a mask, by us and by other programs.

Share measured: of the points asked for. Share wrong: of those measured, with u more than 1 px from the median of
what three of the eight points around or more say (for us, and where neighbours lie 8 px apart for all alike).
pyvale and SUN-DIC run where they are installed (the extra ``peers``), as ``tests.paper.others``
calls them. Needs PHASEDIC_DATA.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from analysis import PhaseKernel, Roi, ZoiGrid
from tests.paper import others

Floats = NDArray[np.float64]
PAIRS = (
    ("dic_challenge_1_sample12_ohtcfrp", "oht_cfrp_00.tiff", "oht_cfrp_02.tiff"),
    ("dic_challenge_1_sample12_ohtcfrp", "oht_cfrp_00.tiff", "oht_cfrp_04.tiff"),
    ("mudic_tension", "ut_151.tif", "ut_160.tif"),
)
STEP, FARTHEST_PX = 8, 1.0


def wrong(u: Floats) -> NDArray[np.bool_]:
    """Values far from the median of those around them, (R, C)."""
    rows, columns = u.shape
    padded = np.pad(u, 1, constant_values=np.nan)
    around = [
        padded[1 + dy : 1 + dy + rows, 1 + dx : 1 + dx + columns]
        for dy in (-1, 0, 1) for dx in (-1, 0, 1) if dy or dx
    ]  # fmt: skip
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # of places without valid neighbours
        middle = np.nanmedian(around, axis=0)
    several = np.isfinite(around).sum(axis=0) >= 3
    return np.asarray(several & (np.abs(u - middle) > FARTHEST_PX))


def ours(size: int) -> Callable[[Any, Any], Floats]:
    def run(reference: Any, deformed: Any) -> Floats:
        height, width = reference.shape
        rim = others.RIM - size // 2
        grid = ZoiGrid.cover(Roi(rim, rim, width - 2 * rim, height - 2 * rim), size, STEP)
        field = PhaseKernel(reference, grid).measure(deformed)
        return np.where(field.ok, field.u, np.nan)

    return run


def engines() -> Iterator[tuple[str, Callable[[Any, Any], Floats]]]:
    yield "phasedic, ZOI 32", ours(32)
    yield "phasedic, ZOI 64", ours(64)
    there = others.installed()
    points = {"pyvale, 33 px": others.pyvale_points, "SUN-DIC, 33 px": others.sun_dic_points}
    for name in there:
        yield name, lambda reference, deformed, run=points[name]: run(reference, deformed).u  # type: ignore[misc]


def main() -> None:
    folder = Path(os.environ["PHASEDIC_DATA"])
    print("| pictures | engine | points | measured % | wrong, of those measured, % |\n|---|---|---|---|---|")
    for name, *files in PAIRS:
        pictures = [cv2.imread(str(folder / name / file), cv2.IMREAD_GRAYSCALE) for file in files]
        for engine, run in engines():
            u = np.asarray(run(*pictures), float)
            found = np.isfinite(u)
            shares = 100 * found.mean(), 100 * wrong(u).sum() / max(found.sum(), 1)
            print(
                f"| {files[0]}, {files[1]} | {engine} | {u.size} | {shares[0]:.1f} | {shares[1]:.3f} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
