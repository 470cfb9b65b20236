"""The dry run before a test: everything that will run is run once, on synthetic frames of the right kind.

Code that is compiled or imported on first use is loaded here, and not while a specimen is loaded.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from acquire.burst import PictureMemory, SumAccumulator
from acquire.frame import Burst, CameraInfo, Frame, frozen
from acquire.load_cell import LoadLog
from live.pipeline.history import History
from live.pipeline.measure import Tracker, measure
from live.pipeline.reference import ReferenceBurst, ReferenceTaker, motion_between, on_fit_machine, prepare

if TYPE_CHECKING:
    from analysis import KernelSettings, ZoiGrid


def picture_kinds(camera: CameraInfo) -> tuple[str, ...]:
    """The kinds of pictures of a camera's frames and bursts (of ``analysis.PICTURE_KINDS``)."""
    return ("uint8" if camera.bits <= 8 else "uint16", "float32")


def dry_run(camera: CameraInfo, grid: ZoiGrid, settings: KernelSettings, bursts: tuple[int, int]) -> None:
    """Average, prepare, measure and evaluate synthetic frames as the test will.

    Parameters
    ----------
    camera : CameraInfo
    grid : ZoiGrid
    settings : KernelSettings
    bursts : (reference, measured)
        Frames in each.

    Raises
    ------
    MachineUnfit
        The machine measures a known pattern wrong.
    """
    from analysis import warm_up

    with on_fit_machine():
        warm_up(kinds=picture_kinds(camera), phase=settings.estimator == "phase")
    images = [_image(camera, seed) for seed in (1, 2)]
    reference = _averaged(camera, images, bursts[0])
    burst = _measured(camera, images, bursts[1])
    kernel, noise_GL = prepare(reference.burst, grid, settings, None, what="measure")
    if reference.halves is not None:
        motion_between(kernel, *reference.halves)
    history = History()
    for measurement in measure([burst, burst], Tracker(kernel, noise_GL), LoadLog()):
        history.add(measurement.time_step)


def _averaged(camera: CameraInfo, images: list[NDArray[Any]], n: int) -> ReferenceBurst:
    """A reference of n frames, the images in turn."""
    *_, taken = map(ReferenceTaker(n).add, _frames(camera, images, n))
    assert taken is not None
    return taken


def _measured(camera: CameraInfo, images: list[NDArray[Any]], n: int) -> Burst:
    """The same as a burst to be measured."""
    *_, taken = map(SumAccumulator(n).add, _frames(camera, images, n))
    assert taken is not None
    return taken.burst(PictureMemory())


def _frames(camera: CameraInfo, images: list[NDArray[Any]], n: int) -> Iterator[Frame]:
    return (Frame(images[i % 2], i, float(i), camera.clock, 0, camera.bits, float(i)) for i in range(n))


def _image(camera: CameraInfo, seed: int) -> NDArray[Any]:
    """A pattern of random blocks with a little noise, which can be measured."""
    shape = (camera.height, camera.width)
    blocks = np.random.default_rng(0).integers(0, 2, (shape[0] // 4 + 1, shape[1] // 4 + 1))
    pattern = np.kron(blocks, np.ones((4, 4), int))[: shape[0], : shape[1]]
    noise = np.random.default_rng(seed).integers(-2, 3, shape)
    image = (0.3 + 0.4 * pattern) * (2**camera.bits - 1) + noise
    return frozen(image.astype(np.uint8 if camera.bits <= 8 else np.uint16))
