"""The motion that a field predicts for the next one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """The motion of the A active ZOIs of a field, to predict the next one.

    Attributes
    ----------
    index : (A,)
        Flat places of the ZOIs on the grid.
    change : (A, modes)
        Of the parameters, a frame.
    ahead : (A, modes)
        What to add to the parameters for the start in the next frame.
    age : (A,) uint8
        Frames that it rests on.
    """

    index: NDArray[np.intp]
    change: Floats
    ahead: Floats
    age: NDArray[np.uint8]

    @classmethod
    def none(cls, index: NDArray[np.intp], modes: int) -> Motion:
        """No motion yet, of ZOIs at known places."""
        return cls(
            index, np.zeros((len(index), modes)), np.zeros((len(index), modes)), np.ones(len(index), np.uint8)
        )

    def fits(self, index: NDArray[np.intp], modes: int) -> bool:
        """Whether this is of the same ZOIs."""
        return self.change.shape == (len(index), modes) and np.array_equal(self.index, index)
