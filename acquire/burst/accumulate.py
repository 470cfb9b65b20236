"""From frames to bursts: the mean of n consecutive frames, its noise, its clipped pixels and its motion.

The live grab thread and a replay use the same ``BurstAccumulator``. Sums are whole numbers, so a burst of the same
frames is the same to the last bit. Nothing here reads a clock or a file.

Averaging frames of a moving picture smears it: contrast at wave number k falls by |sinc(k v T / 2)|. The motion
is estimated from the first and the last frame of the burst by the optical flow of a few large tiles (Lucas and
Kanade, 1981): crude beside the measuring kernel, but cheap enough for every burst.
"""

from __future__ import annotations

import logging
import math
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Sequence
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import DTypeLike, NDArray

from acquire.burst.memory import PictureMemory
from acquire.errors import ConfigError, DataError
from acquire.frame import Burst, Frame, frozen
from acquire.text import Message

Made = TypeVar("Made")
LIMIT_PX = 0.05  # above it a burst is smeared
TILE_PIXELS = 4096  # looked at in each tile at least, so that noise gives less than about 0.01 px
MAX_TILES = 4
ROW_STEP = 4

log = logging.getLogger(__name__)

MAX_FRAMES = 65536  # a sum of so many 16-bit samples still fits into 32 bits


def motion_between_frames(first: NDArray[Any], last: NDArray[Any], noise: float) -> float:
    """Largest motion of any part of the picture between two frames, px.

    Parameters
    ----------
    first, last : (H, W) uint8 | uint16, GL
    noise : float, GL
        Standard deviation of one frame.

    Returns
    -------
    float, px
        Reliable below about one pixel, and large above it; NaN where there is nothing to see.
    """
    from acquire.burst.accumulate_loops import tile_sums

    rows, columns, step = _tiles(*first.shape)
    sums = tile_sums(first, last, rows, columns, step)
    motions = [_solve(*tile, noise=noise) for tile in sums.reshape(-1, 6).tolist()]
    seen = [motion for motion in motions if not math.isnan(motion)]
    return max(seen, default=math.nan)


def _tiles(height: int, width: int) -> tuple[int, int, int]:
    step = ROW_STEP if height * width >= 2**18 else 1
    across = min(MAX_TILES, max(1, math.isqrt(height * width // (step * TILE_PIXELS))))
    return across, across, step


def _solve(xx: float, xy: float, yy: float, xd: float, yd: float, n: float, *, noise: float) -> float:
    """Displacement of one tile from its normal equations; NaN without contrast in both directions."""
    # What noise adds to the squares of a gradient of the mean of two frames.
    noise_square = n * noise**2 / 4
    xx, yy = xx - noise_square, yy - noise_square
    middle, half = (xx + yy) / 2, math.hypot((xx - yy) / 2, xy)
    if n == 0 or middle - half <= max(noise_square, 0.01 * n):
        return math.nan
    determinant = xx * yy - xy * xy
    u, v = (yy * xd - xy * yd) / determinant, (xx * yd - xy * xd) / determinant
    # Without what noise alone would show; the variance of a difference is twice that of a frame.
    return math.sqrt(max(0.0, u * u + v * v - 2 * noise**2 * (xx + yy) / determinant))


@cache
def compile_loops(kinds: tuple[str, ...] = ("uint8", "uint16")) -> None:
    """Have the loops ready for frames of these types (once a process), so that none is lost to a compiler later."""
    from acquire.burst.accumulate_loops import GROUP, fold, mean_of_sum, scratch, tile_sums

    if not (
        fold.stats.cache_path and any(Path(fold.stats.cache_path).glob("accumulate_loops.tile_sums-*.nbi"))
    ):
        log.info(Message("compiling the burst loops, once on this machine; this takes some seconds"))
    mean, clipped = np.empty(9, np.float32), np.empty(9, np.bool_)
    for kind, of_sum in product(kinds, (np.uint16, np.uint32)):
        image, total = frozen(np.zeros((3, 3), kind)), np.empty(9, of_sum)
        frames, rooms = (image.reshape(-1),) * GROUP, scratch(kind)
        fold(frames, 1, frames[0], *rooms, total, mean, clipped, 255, True, 1)
        for one in (total, frozen(total.copy())):  # of a recording; of a live burst
            mean_of_sum(one, 1, mean)
        tile_sums(image, image, 1, 1, 1)


class Accumulator(ABC, Generic[Made]):
    """Takes frames one by one and gives a burst after every n consecutive, undamaged ones.

    A gap in the sequence or a damaged frame starts the burst anew. What was lost or damaged is
    counted in ``Burst.lost`` of the next burst; whole frames that were left out are not.

    Parameters
    ----------
    n : int
        Frames in a burst, 1..65536.
    not_before : float, s
        Frames whose time is earlier are left out: those that lay in the driver's buffers
        when the burst was asked for.
    memory : PictureMemory, optional
        That of its bursts; by default its own.

    Raises
    ------
    ConfigError
        An impossible n.
    """

    def __init__(self, n: int, *, not_before: float = -math.inf, memory: PictureMemory | None = None) -> None:
        if not 1 <= n <= MAX_FRAMES:
            raise ConfigError("a burst of {n} frames is not possible; allowed: 1 to {most}", n, MAX_FRAMES)
        self._n, self._not_before = n, not_before
        self._memory = memory or PictureMemory()
        self._times: list[float] = []
        self._sums: FrameSums | None = None
        self._lost = 0
        self._first = self._last = -1

    def add(self, frame: Frame) -> Made | None:
        """Take a frame; the burst when this one completes it.

        Raises
        ------
        DataError
            The picture is of another size or depth than the one before.
        """
        if self._times and (frame.lost_before > 0 or frame.index != self._last + 1):
            self._start_anew()
        self._lost += frame.lost_before
        if frame.damaged or frame.t < self._not_before:
            self._start_anew()
            self._lost += frame.damaged
            return None
        if not self._times:
            self._first = frame.index
            self._sums = self._begun(frame) if self._n > 1 else None
        self._last = frame.index
        self._times.append(frame.t)
        done = len(self._times) == self._n
        if self._sums is not None:
            self._sums.add(frame, self._n if done else 0)
        if not done:
            return None
        made = self._single(frame) if self._sums is None else self._finished(self._sums, frame)
        self._times, self._sums, self._lost = [], None, 0
        return made

    def _start_anew(self) -> None:
        self._times, self._sums = [], None

    @abstractmethod
    def _begun(self, frame: Frame) -> FrameSums:
        """The sums of a burst that begins with this frame."""

    @abstractmethod
    def _single(self, frame: Frame) -> Made:
        """A burst of one is the frame itself: nothing is averaged, nothing copied."""

    @abstractmethod
    def _finished(self, sums: FrameSums, last: Frame) -> Made:
        """The burst of all its frames."""

    def _numbers(self, last: Frame, sums: FrameSums | None = None) -> dict[str, Any]:
        """What ``Burst`` has beside its pictures."""
        start, times, n = self._times[0], self._times, self._n
        noise = math.nan if sums is None else sums.noise(n)
        return {
            "n": n,
            "noise": noise,
            "bits": last.bits,
            "t": start + math.fsum(t - start for t in times) / n,
            "duration": times[-1] - start,
            "first_index": self._first,
            "last_index": self._last,
            "lost": self._lost,
            "clock": last.clock,
            "motion_px": math.nan if sums is None else sums.motion(last, n, noise),
            "blank": 0 if sums is None else sums.blank,
        }


class BurstAccumulator(Accumulator[Burst]):
    """From frames to bursts with their means."""

    def _begun(self, frame: Frame) -> FrameSums:
        return FrameSums(frame, self._memory)

    def _single(self, frame: Frame) -> Burst:
        clipped = clipped_in(frame.image, frame.saturation, self._memory)
        return Burst(mean=frame.image, clipped=clipped, **self._numbers(frame))

    def _finished(self, sums: FrameSums, last: Frame) -> Burst:
        mean, clipped = frozen(sums.mean), frozen(sums.clipped)
        return Burst(mean=mean, clipped=clipped, **self._numbers(last, sums))


def clipped_in(image: NDArray[Any], saturation: int, memory: PictureMemory) -> NDArray[np.bool_]:
    """Which pixels of an image are saturated, read-only."""
    clipped = memory.take(image.shape, np.bool_)
    np.greater_equal(image, saturation, out=clipped)
    return frozen(clipped)


class FrameSums:
    """The running sums of one burst. Frames are kept, not copied, until a group can be folded.

    Parameters
    ----------
    like : Frame
        The first one.
    memory : PictureMemory
    kind : uint16 or uint32, optional
        Of the sum, which is all that is made then; by default the mean is made.

    Attributes
    ----------
    contrasts : list of float, GL
        Standard deviation over some thousand pixels of each frame.
    """

    def __init__(self, like: Frame, memory: PictureMemory, kind: DTypeLike | None = None) -> None:
        compile_loops((like.image.dtype.name,))
        self._like, self._memory = like, memory
        self._summed, self._kind_of_sum = kind is not None, np.uint32 if kind is None else kind
        self.mean = (
            np.empty((0, 0), np.float32) if self._summed else memory.take(like.image.shape, np.float32)
        )
        self.clipped = memory.take(like.image.shape, np.bool_)
        self._total: NDArray[Any] = np.empty(0, self._kind_of_sum)
        self._waiting: list[NDArray[Any]] = []
        self._previous: NDArray[Any] | None = None
        self._squares = 0
        self.contrasts: list[float] = []

    @property
    def total(self) -> NDArray[Any]:
        """The sum of all frames (H, W), GL."""
        return self._total.reshape(self._like.image.shape)

    def add(self, frame: Frame, n: int) -> None:
        """Take a frame; ``n > 0``: it is the last of n."""
        from acquire.burst.accumulate_loops import GROUP

        if (frame.image.shape, frame.image.dtype, frame.bits) != self._kind:
            raise DataError(
                "frame {index} is {this}, but the burst began with {first}; one burst needs frames of one kind",
                frame.index,
                _words(frame),
                _words(self._like),
            )
        step = max(1, math.isqrt(frame.image.size // TILE_PIXELS))
        self.contrasts.append(float(frame.image[::step, ::step].std()))
        self._waiting.append(np.ascontiguousarray(frame.image).reshape(-1))
        if n > 0 or len(self._waiting) == GROUP:
            self._fold(0 if self._summed else n)

    @property
    def blank(self) -> int:
        """Which picture has less than half the contrast of another, from 1; 0: none."""
        least = min(self.contrasts)
        return self.contrasts.index(least) + 1 if 2 * least < max(self.contrasts) else 0

    @property
    def _kind(self) -> tuple[Any, ...]:
        return self._like.image.shape, self._like.image.dtype, self._like.bits

    def _fold(self, n: int) -> None:
        from acquire.burst.accumulate_loops import GROUP, fold, scratch

        images, first = self._waiting, self._previous is None
        if not (first and n) and self._total.size == 0:
            self._total = self._memory.take(self._like.image.shape, self._kind_of_sum).reshape(-1)
        self._squares += int(
            fold(
                tuple(images + images[-1:] * (GROUP - len(images))),
                len(images),
                images[0] if self._previous is None else self._previous,
                *scratch(images[0].dtype),
                self._total,
                self.mean.reshape(-1),
                self.clipped.reshape(-1),
                self._like.saturation,
                first,
                n,
            )
        )
        self._previous, self._waiting = images[-1], []

    def noise(self, n: int) -> float:
        """Noise of one frame, GL, from successive differences, so that slow motion hardly counts."""
        return math.sqrt(self._squares / (2 * (n - 1) * self._like.image.size)) if n > 1 else math.nan

    def motion(self, last: Frame, n: int, noise: float) -> float:
        """During the exposure of all n frames, px: from the first to the last, and one frame more."""
        if n < 2:
            return math.nan
        return motion_between_frames(self._like.image, last.image, noise) * n / (n - 1)


def _words(frame: Frame) -> str:
    height, width = frame.image.shape
    return Message("{width}x{height} {dtype} with {bits} bits", width, height, frame.image.dtype, frame.bits)


def average_bursts(frames: Iterable[Frame], n: int, *, not_before: float = -math.inf) -> Iterator[Burst]:
    """Complete bursts of n consecutive undamaged frames.

    Parameters
    ----------
    frames : iterable of Frame
    n : int
        Frames in a burst.
    not_before : float, s
        Earlier frames are left out.

    Raises
    ------
    ConfigError
        An impossible n, at once.
    DataError
        Frames of different kinds.
    """
    accumulator = BurstAccumulator(n, not_before=not_before)
    return (burst for burst in map(accumulator.add, frames) if burst is not None)


def burst_of(frames: Sequence[Frame]) -> Burst:
    """One burst of exactly these frames.

    Raises
    ------
    ConfigError
        No frames.
    DataError
        They are not consecutive, or one is damaged.
    """
    bursts = list(average_bursts(frames, len(frames)))
    if not bursts:
        raise DataError(
            "frames {first} to {last} are not {n} consecutive whole frames; choose others",
            frames[0].index,
            frames[-1].index,
            len(frames),
        )
    return bursts[0]
