"""Other engines on the same pair: speed and, beside it, how wrong they are.

OpenCV's engines always; pyvale and SUN-DIC where they are installed, through ``tests.paper.others``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import cv2
import numba
import numpy as np
from numpy.typing import NDArray

from analysis import ZoiGrid
from tests.paper import others
from tests.paper.others import Points

Flow = Callable[[], NDArray[np.floating]]
HOW_TO_ADD = """The extra `peers` adds them: about 3 GB, and builds of OpenCV that overwrite ours, so best in an
environment of its own: `python3 -m venv ../peers && ../peers/bin/pip install --editable '.[test,peers]' &&
../peers/bin/python -m tests.bench`. (`.venv/bin/pip install --editable '.[peers]'`, then `make bench`, runs too.)
Should `import cv2` fail afterwards, `pip install --force-reinstall --no-deps opencv-contrib-python-headless` in that
environment puts it right."""


@dataclass(frozen=True)
class Peer:
    """An engine on one pair.

    Attributes
    ----------
    name : str
    run : callable
        One whole call of it; the points it found and u there, px.
    note : str
        What the call includes.
    repeats : int
        Timed calls, after one that is not.
    optional : bool
        Somebody else's program, which may fail without ending the bench.
    """

    name: str
    run: Callable[[], Points]
    note: str = ""
    repeats: int = 3
    optional: bool = False


def pyramidal_lucas_kanade(reference: NDArray, deformed: NDArray, points: NDArray, window: int = 33) -> Flow:
    start = np.ascontiguousarray(points, np.float32)[:, None, :]

    def run() -> NDArray[np.floating]:
        found, _, _ = cv2.calcOpticalFlowPyrLK(
            reference, deformed, start, None, winSize=(window, window), maxLevel=2
        )
        return (found - start)[:, 0]

    return run


def dis_flow(reference: NDArray, deformed: NDArray, points: NDArray) -> Flow:
    engine = cv2.DISOpticalFlow_create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)  # type: ignore[attr-defined]

    def run() -> NDArray[np.floating]:
        flow = engine.calc(reference, deformed, None)
        column, row = points.T.astype(np.float32)
        return np.stack(
            [cv2.remap(flow[..., c], column[None], row[None], cv2.INTER_LINEAR)[0] for c in (0, 1)], axis=1
        )

    return run


def peers(reference: NDArray, deformed: NDArray, grid: ZoiGrid) -> Iterator[Peer]:
    """OpenCV's engines, then the programs that are installed; 8-bit images (H, W)."""
    x, y = np.meshgrid(grid.x, grid.y)
    points = np.stack([x, y], axis=-1).reshape(-1, 2)

    def at_points(flow: Flow) -> Callable[[], Points]:
        return lambda: Points(x, y, flow()[:, 0].astype(float).reshape(grid.shape))

    yield Peer(
        "OpenCV PyrLK, 33 px, 3 levels", at_points(pyramidal_lucas_kanade(reference, deformed, points))
    )
    yield Peer("OpenCV DIS (dense)", at_points(dis_flow(reference, deformed, points)))
    yield from programs(reference, deformed)


def programs(reference: NDArray, deformed: NDArray) -> Iterator[Peer]:
    """pyvale and SUN-DIC as their users call them, on all cores, where they can be imported.

    pyvale keeps its subsets out of the rim, SUN-DIC their centres: with half a subset more both have the
    same points.
    """
    here = others.installed()
    cores = numba.get_num_threads()
    name = "pyvale, 33 px"
    if name in here:
        yield Peer(
            name,
            lambda: others.pyvale_points(reference, deformed, cores),
            f"a whole call, reference and search included: {cores} threads, results written and read",
            repeats=2,
            optional=True,
        )
    name = "SUN-DIC, 33 px"
    if name in here:
        yield Peer(
            name,
            lambda: others.sun_dic_points(reference, deformed, others.RIM + others.SUBSET // 2, cores),
            f"a whole call, reference and search included: images written, Ray started for {cores} processes, "
            "results written and read",
            repeats=2,
            optional=True,
        )


def missing() -> list[str]:
    """Optional peers that are not installed here."""
    here = others.installed()
    return [name.partition(",")[0] for name in others.PROGRAMS if name not in here]
