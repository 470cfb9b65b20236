"""Bursts that wait to be measured, in little memory: the exact sum of their frames, and no mask where none is clipped.

Mean and mask are made once a burst is measured, with the same bits as those of ``BurstAccumulator``.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquire.burst.accumulate import Accumulator, FrameSums, clipped_in
from acquire.burst.memory import PictureMemory
from acquire.frame import Burst, Frame, frozen

_NO_PICTURE, _NOT_CLIPPED = frozen(np.empty((0, 0), np.float32)), frozen(np.empty((0, 0), np.bool_))


@dataclass(frozen=True, slots=True, eq=False)
class SummedBurst:
    """A burst before its mean is made.

    Attributes
    ----------
    total : (H, W) uint16 or uint32, GL; of one frame the frame itself, uint8 or uint16
        The sum of its frames.
    flags : flat uint8, or None
        The clipped pixels, packed; None: there are none, or it is one frame.
    white : int or None, GL
        From which level on pixels of a single frame are clipped; None: none is, or it is not a single frame.
    numbers : Burst
        All else; without pictures.
    """

    total: NDArray[Any]
    flags: NDArray[np.uint8] | None
    white: int | None
    numbers: Burst

    @property
    def n(self) -> int:
        """Frames in it."""
        return self.numbers.n

    @property
    def lost(self) -> int:
        """Frames lost or damaged since the end of the burst before."""
        return self.numbers.lost

    @property
    def first_index(self) -> int:
        """Sequence number of its first frame."""
        return self.numbers.first_index

    @property
    def last_index(self) -> int:
        """Sequence number of its last frame."""
        return self.numbers.last_index

    @property
    def nbytes(self) -> int:
        """Memory of its pictures, bytes."""
        return self.total.nbytes + (0 if self.flags is None else self.flags.nbytes)

    def without_pictures(self) -> SummedBurst:
        """Its numbers alone, which take no memory."""
        return replace(self, total=_NO_PICTURE, flags=None, white=None)

    def burst(self, memory: PictureMemory) -> Burst:
        """The burst, its pictures in ``memory``."""
        from acquire.burst.accumulate_loops import mean_of_sum

        mean = self.total
        if self.n > 1:
            mean = memory.take(self.total.shape, np.float32)
            mean_of_sum(self.total.reshape(-1), self.n, mean.reshape(-1))
        return replace(self.numbers, mean=frozen(mean), clipped=self._clipped(memory))

    def _clipped(self, memory: PictureMemory) -> NDArray[np.bool_]:
        if self.white is not None:
            return clipped_in(self.total, self.white, memory)
        if self.flags is None:
            return nothing_clipped(self.total.shape)
        clipped = memory.take(self.total.shape, np.bool_)
        clipped.reshape(-1)[:] = np.unpackbits(self.flags, count=self.total.size)
        return frozen(clipped)


@lru_cache(maxsize=2)
def nothing_clipped(shape: tuple[int, int]) -> NDArray[np.bool_]:
    """A mask without a clipped pixel, (H, W), shared by all that need one."""
    return frozen(np.zeros(shape, np.bool_))


def sum_kind(bits: int, n: int) -> np.dtype[Any]:
    """What the sum of n frames takes a pixel: uint16 where n times full scale fits, else uint32."""
    return np.dtype(np.uint16 if (2**bits - 1) * n < 2**16 else np.uint32)


class SumAccumulator(Accumulator[SummedBurst]):
    """From frames to bursts that wait for their mean."""

    def _begun(self, frame: Frame) -> FrameSums:
        return FrameSums(frame, self._memory, sum_kind(frame.bits, self._n))

    def _single(self, frame: Frame) -> SummedBurst:
        white = frame.saturation if frame.image.max() >= frame.saturation else None
        return SummedBurst(frame.image, None, white, _numbers(self._numbers(frame)))

    def _finished(self, sums: FrameSums, last: Frame) -> SummedBurst:
        flags = np.packbits(sums.clipped) if sums.clipped.any() else None
        return SummedBurst(frozen(sums.total), flags, None, _numbers(self._numbers(last, sums)))


def _numbers(numbers: dict[str, Any]) -> Burst:
    return Burst(mean=_NO_PICTURE, clipped=_NOT_CLIPPED, **numbers)
