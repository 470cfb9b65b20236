"""Other engines on the same pair: speed and, beside it, how wrong they are."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

Flow = Callable[[], NDArray[np.floating]]


@dataclass(frozen=True)
class Peer:
    """A name and a function that gives the displacement (u, v) at the points, (N, 2)."""

    name: str
    run: Flow


def pyramidal_lucas_kanade(reference: NDArray, deformed: NDArray, points: NDArray, window: int = 33) -> Flow:
    start = np.ascontiguousarray(points, np.float32)[:, None, :]

    def run() -> NDArray[np.floating]:
        found, _, _ = cv2.calcOpticalFlowPyrLK(
            reference, deformed, start, None, winSize=(window, window), maxLevel=2
        )
        return (found - start)[:, 0]

    return run


def dis_flow(reference: NDArray, deformed: NDArray, points: NDArray) -> Flow:
    engine = cv2.DISOpticalFlow_create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)

    def run() -> NDArray[np.floating]:
        flow = engine.calc(reference, deformed, None)
        column, row = points.T.astype(np.float32)
        return np.stack(
            [cv2.remap(flow[..., c], column[None], row[None], cv2.INTER_LINEAR)[0] for c in (0, 1)], axis=1
        )

    return run


def peers(reference: NDArray, deformed: NDArray, points: NDArray) -> Iterator[Peer]:
    """OpenCV's engines; 8-bit images, points (N, 2) as (x, y)."""
    yield Peer("OpenCV PyrLK, 33 px, 3 levels", pyramidal_lucas_kanade(reference, deformed, points))
    yield Peer("OpenCV DIS (dense)", dis_flow(reference, deformed, points))


def missing() -> list[str]:
    """Optional peers that are not installed here."""
    return [name for name in ("pyvale", "sundic") if importlib.util.find_spec(name) is None]
