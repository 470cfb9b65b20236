"""Compile everything ahead of a test, so that nothing compiles during it.

The iteration takes as long to compile as all the rest, so two processes can share the work:
``warm_up(ITERATION)`` in one and ``warm_up(REST)`` in the other; a third then loads both from numba's cache.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from acquire.text import Message
from analysis.compiled.forked import FORK_CHECK
from analysis.field import Motion, Roi, Status, StrainField, ZoiGrid, profile
from analysis.kernel.images import as_image
from analysis.picture.splines import Box

if TYPE_CHECKING:
    from analysis.fit.kernel_args import PictureArgs

log = logging.getLogger("analysis")

COMPILE_SECONDS = 65
"""About how long one process takes for everything; for the announcement."""
FUNCTIONS, FUNCTIONS_OF_KIND, FUNCTIONS_OF_PHASE = 38, 1, 3
"""That are kept in all, more for each kind of pictures, and for the estimator by phases."""
ITERATION, REST, PHASE, ALL = "iteration", "rest", "phase", "all"
COMPILE_PARTS = (ITERATION, REST)
PICTURE_KINDS = ("uint8", "uint16", "float32")
"""Of pictures: frames of up to 8 and 16 bits, means of bursts."""


def not_compiled(kinds: Sequence[str] = PICTURE_KINDS, *, phase: bool = True) -> bool:
    """Whether numba's cache lacks a loop that pictures of these kinds (and the estimator by phases) need."""
    from analysis.compiled.loops import is_cached
    from analysis.picture import prefilter

    loops = _loops(phase)
    return not (all(map(is_cached, loops)) and all(is_cached(prefilter.coefficients, kind) for kind in kinds))


def _loops(phase: bool) -> list[Any]:
    from analysis.compiled import sparse_sums
    from analysis.fit import assembly, iteration, pooling, sensitivity, shared, sums, verdict
    from analysis.follow import coherence, hill_climb, prediction, search

    loops = [
        sensitivity.prepare, iteration.track, shared.share_warps, search.match, hill_climb.climb,
        prediction.advance, verdict.judge, coherence.stand_out, coherence.label,
        assembly.expect, assembly.weigh, assembly.weigh_blur, pooling.explained, pooling.row_medians,
        pooling.interpolate, assembly.scale, assembly.clipped_shares, sums.squares, iteration.warp_zois,
        sparse_sums.row_sums, sparse_sums.overlapping,
    ]  # fmt: skip
    return loops + [iteration.compose_all, iteration.within_image] * phase


def share_compiled(kinds: Sequence[str], since: float, *, phase: bool) -> float:
    """About how much of a compilation from nothing is done, 0 to 1, that began at ``since``, s since the epoch."""
    from analysis.compiled.loops import compiled_since
    from analysis.picture import prefilter

    functions = FUNCTIONS + FUNCTIONS_OF_KIND * len(kinds) + FUNCTIONS_OF_PHASE * phase
    return min(compiled_since([*_loops(phase), prefilter.coefficients], since) / functions, 1.0)


def numerics() -> dict[str, str]:
    """What the last digits of every result belong to: processor, width of its vectors, and the loops themselves."""
    from analysis.compiled.loops import digest
    from analysis.compiled.vectors import LANES, PROCESSOR

    return {"processor": PROCESSOR, "vectors": f"{LANES} float32", "loops": digest()}


def threads() -> str:
    """How many threads the loops have, and by which library: "2 by OpenMP" and the like."""
    import numba

    return Message("{n} by {library}", numba.get_num_threads(), threading_library())


def threading_library() -> str:
    """The library that runs the threads of the loops: "OpenMP", "TBB" or "numba's workqueue"."""
    from analysis.compiled.layer import threading_layer

    return {"omp": "OpenMP", "tbb": "TBB", "workqueue": "numba's workqueue"}[threading_layer()]


def warm_up(part: str = ALL, kinds: Sequence[str] = PICTURE_KINDS, *, phase: bool = True) -> None:
    """Compile, or load from numba's cache, every loop that a kernel can need.

    The first time on a machine this takes a minute or two and is announced in the log.

    Parameters
    ----------
    part : "all" | "iteration" | "rest" | "phase"
    kinds : sequence of str
        Of the pictures that will come.
    phase : bool
        Also for the estimator by phases.

    Raises
    ------
    MachineError
        What is compiled measures a known pattern wrong; of "all" alone.
    """
    if part == ITERATION:
        _iteration()
        return
    if part == REST:
        _prefilter(kinds)
        _rest()
        return
    if part == PHASE:
        _phase()
        return
    if not_compiled(kinds, phase=phase):
        log.info(Message("compiling the kernel for this machine, once, about {s} s", COMPILE_SECONDS))
    _everything(kinds, phase)


def _everything(kinds: Sequence[str], phase: bool) -> None:
    """Measure small pictures in every way that a test can."""
    from analysis.fit.pooling import interpolate
    from analysis.kernel.images import NoiseModel
    from analysis.kernel.phase_kernel import PhaseKernel
    from analysis.kernel.settings import KernelSettings

    _gauges()
    interpolate(np.ones(1), np.arange(2.0), np.ones(2), np.ones(1))  # not reached with so few ZOIs
    _iteration()  # of it ``warp_zois``
    image, grid = _small()
    ways = [KernelSettings(), KernelSettings(order=2)]
    clipped = image > np.percentile(image, 99)
    for settings in [*ways, *([KernelSettings(estimator="phase")] * phase)]:
        kernel = PhaseKernel(image, grid, settings, NoiseModel(0.1, 1.0), clipped)
        field = kernel.measure(image, clipped=clipped)
        field.mean("exx")
        kernel.measure(image, start=field)
    for kind in kinds:
        kernel.measure(image.astype(kind), start=field)


def _small() -> tuple[NDArray[np.float32], ZoiGrid]:
    """A picture, (96, 96) float32, and a grid on it."""
    y, x = np.mgrid[:96, :96].astype(np.float32)
    image = 100 + 40 * np.sin(x * 1.3 + 0.2 * y) * np.cos(0.9 * y - 0.35 * x)
    return image, ZoiGrid.cover(Roi(8, 8, 80, 80), size=32, step=16)


def _iteration() -> None:
    """The iteration, and the warp, which has most of it: called for no ZOI at all, they are compiled all the same."""
    from analysis.fit.iteration import track, warp_zois
    from analysis.fit.kernel_args import FitArgs, OutArgs, StopArgs
    from analysis.fit.shared import share_warps
    from analysis.fit.tiles import Tiles

    none, no_images = np.empty(0), np.empty((0, 6, 6), np.float32)
    no_bias, no_warped = np.empty((0, 6), np.float32), np.empty((0, 32, 32), np.float32)
    no_origins, no_zois = np.empty((0, 2), np.int64), np.empty(0, np.int64)
    fit = FitArgs(
        np.empty(0, np.float32), 0, 0, no_zois, no_origins, 32, 16, 1,
        np.empty((4, 32), np.float32), np.empty((4, 4)), no_images, no_images, np.empty((0, 2)), np.empty(6),
        no_bias, none, none,
    )  # fmt: skip
    picture, table, stop = _no_picture(), np.empty(18, np.float32), StopArgs(none, none, none, 12)
    out = OutArgs.starting(np.empty((0, 6)))
    share_warps(picture, table, fit, stop, out, Tiles.of(no_origins, 32, 16))
    track(picture, table, fit, stop, out, no_zois)
    warp_zois(picture, table, no_origins, 32, out.p, no_warped)


def _no_picture() -> PictureArgs:
    from analysis.fit.kernel_args import PictureArgs

    return PictureArgs.within(np.empty(0, np.float32), (0, 0), Box.of((0, 0), (0, 0), (0, 0)), 0.5)


def _phase() -> None:
    """What only the estimator by phases needs, again for no ZOI at all."""
    from analysis.fit.iteration import compose_all, within_image

    picture, origins, p = _no_picture(), np.empty((0, 2), np.int64), np.empty((0, 6))
    within_image(picture, origins, 32, p, np.empty(0, np.bool_))
    compose_all(p, p)


def _prefilter(kinds: Sequence[str]) -> None:
    """What every deformed image goes through first, for each kind of picture."""
    from analysis.picture.prefilter import coefficients, room_for
    from analysis.picture.splines import prefilter_poles

    for kind in kinds:
        picture = _small()[0].astype(kind)
        picture.flags.writeable = False
        room = room_for(picture.shape)
        coefficients(picture, np.float32(100), prefilter_poles(5), Box(0, 96, 0, 96), room)


def _rest() -> None:
    """All but the iteration, the prefilter and what only the estimator by phases needs."""
    from analysis.fit.assembly import ExpectedNoise, clipped_share, expect, scale, weigh, weigh_blur
    from analysis.fit.kernel_args import OutArgs, PooledError, ReferenceArgs, VerdictArgs
    from analysis.fit.pooling import explained, interpolate, median
    from analysis.fit.verdict import judge
    from analysis.follow.parts import coherent
    from analysis.follow.prediction import motion_after
    from analysis.kernel.reference import ReferencePicture
    from analysis.kernel.settings import KernelSettings

    _gauges()
    image, grid = _small()
    FORK_CHECK.check()
    # No PhaseKernel: its self-test would compile the iteration.
    reference = ReferencePicture.first(as_image(image, "the pattern"), grid, KernelSettings(), None, None)
    reference.searched(image)
    if reference.sums is not None:
        reference.sums.factor("exx", grid.active)
    line = profile("gaussian", 32)
    clipped_share(np.zeros((32, 32), np.bool_), np.zeros((1, 2), np.int64), line)
    none, pairs, single = np.empty(0), np.empty((0, 2)), np.empty(0, np.float32)
    found, known = (
        OutArgs.starting(np.empty((0, 6))),
        ReferenceArgs(none, none, pairs, none, np.ones(2), 1.0, 1.0, none, 0.5),
    )
    rule = VerdictArgs(True, np.empty(2), 1.0, 0.05, 4.0, 6.0)
    judge(found, none, none, PooledError.none(0), known, rule, np.empty(0, np.uint8))
    explained(found, none, none, known, np.empty(0, np.intp), 1, pairs)
    median(np.ones(2))
    interpolate(np.ones(1), np.arange(2.0), np.ones(2), np.ones(1))
    weigh_blur(single, single, single)
    expected = ExpectedNoise(np.empty(2), np.empty(2))
    expect(np.ones(2), (0.5, 0.5), np.ones(2), np.ones(2), 0.0, expected)
    weigh(np.empty(0, np.bool_), none, none, none, none, none, none, np.empty((0, 6)), single, single, single)
    unit = np.empty((21, 0), np.float32)
    scale(unit, np.ones(21, np.float32), single, single, unit, unit)
    index, values = np.empty(0, np.intp), np.empty((0, 6))
    motion_after(Motion.none(index, 6), values, values, none, 1.0)
    still = StrainField.from_values(grid, {}, 0.1)
    # Parts are looked for where ZOIs are lost.
    coherent(replace(still, status=np.where(grid.x > 50, np.uint8(Status.LOST), still.status)))


def _gauges() -> None:
    """The sums over gauges, for none."""
    from analysis.compiled.loops import read_only
    from analysis.compiled.sparse_sums import overlapping, row_sums

    first, no, none, triples = np.zeros(1, np.intp), np.empty(0, np.intp), np.empty(0), np.empty((0, 3))
    covariance = read_only(np.empty((21, 0), np.float32))
    row_sums(first, no, none, triples, triples)
    overlapping(
        first, no, none, triples.astype(np.intp), triples, no, np.empty((4, 1, 1)), 1, covariance, none
    )
