"""Saturated pixels reach the kernel: from the frames to the status, in a run and in its replay."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from acquire.burst.accumulate import burst_of
from acquire.frame import Burst, Frame, frozen
from acquire.load_cell.load_log import LoadLog
from analysis import KernelSettings, Roi, Status, ZoiGrid
from live.cli import main
from live.pipeline.measure import NewReference, Tracker, measure
from live.pipeline.reference import prepare
from live.results import Strain
from tests.analysis.speckle import SHAPE, picture

GRID = ZoiGrid.cover(Roi(24, 24, 160, 128), size=32, step=16)
CORNER = np.zeros(SHAPE, bool)
CORNER[:72, :72] = True


def burst(number: int, clipped: np.ndarray) -> Burst:
    """Of the still pattern; the grey levels of clipped pixels are as they would be without clipping."""
    mean = frozen(picture().astype(np.float32))
    return Burst(mean, 1, math.nan, clipped, 12, float(number), 0.0, number, number, 0, "nominal")


def test_a_zoi_on_clipped_pixels_has_no_value() -> None:
    clear = np.zeros(SHAPE, bool)
    kernel, noise = prepare(burst(0, clear), GRID, KernelSettings(), 4.0)
    found = list(
        measure([burst(1, clear), burst(2, CORNER), burst(3, clear)], Tracker(kernel, noise), LoadLog())
    )
    status = [m.field.status[1, 1] for m in found]
    assert status == [Status.OK, Status.CLIPPED, Status.OK]
    assert math.isnan(found[1].field.u[1, 1]) and found[1].field.status[-1, -1] == Status.OK
    assert (
        found[1].time_step.refused == f"{np.count_nonzero(found[1].field.status == Status.CLIPPED)} CLIPPED"
    )


@pytest.mark.parametrize("renewed", [False, True])
def test_a_reference_with_clipped_pixels_has_no_value_there(renewed: bool) -> None:
    """Also where the light has fallen since, and the pixels of today are sound."""
    clear = np.zeros(SHAPE, bool)
    kernel, noise = prepare(burst(0, clear if renewed else CORNER), GRID, KernelSettings(), 4.0)
    steps = [NewReference(burst(1, CORNER))] if renewed else []
    (found,) = measure([*steps, burst(2, clear)], Tracker(kernel, noise), LoadLog())
    assert found.field.status[1, 1] == Status.CLIPPED and found.field.status[-1, -1] == Status.OK


@pytest.mark.parametrize("n", [1, 2, 5, 9])
def test_a_pixel_at_the_top_in_any_frame_is_clipped(n: int) -> None:
    images = [np.full((8, 8), 4094, np.uint16) for _ in range(n)]
    images[-1][3, 4] = images[0][6, 1] = 4095
    frames = [Frame(frozen(image), k, k / 10, "nominal", 0, 12, k / 10) for k, image in enumerate(images)]
    assert np.argwhere(burst_of(frames).clipped).tolist() == [[3, 4], [6, 1]]


def clipped(folder: Path) -> np.ndarray:
    """ZOIs without a value since they are clipped, at each instant."""
    with Strain.open(folder / "strain.h5") as strain:
        return np.sum(strain.maps("status") == Status.CLIPPED, axis=(1, 2))


@pytest.mark.parametrize("length", ["1", "2"])
def test_a_bright_run_and_its_replay(length: str, tmp_path: Path) -> None:
    camera = "sim:uniform?lockstep=yes&seconds=1&fps=10&width=208&height=160&bits=12&brightness=1.2"
    words = ["--zoi", "32", "--step", "32", "--burst", length, "--no-view", "--no-rrd"]
    run = ["run", "--camera", camera, "--load", "sim:", "--reference-burst", "2"]
    main([*run, *words, "--out", str(tmp_path / "run")])
    main(["replay", str(tmp_path / "run" / "session.h5"), *words, "--out", str(tmp_path / "again")])
    live, again = clipped(tmp_path / "run"), clipped(tmp_path / "again")
    assert live.min() >= 3 and live.tolist() == again.tolist()
