"""Where strain is measured: the region of interest, the regular grid of ZOIs in it, and the window of a ZOI.

A ZOI (zone of interest) is a square of ``size`` pixels; its values stand at its centre. The window is the
least-squares weight of its pixels: a product of one line along x and the same line along y. ``gaussian`` has
sigma = size/6. Where the paper has an analysis window, the weight of its least squares is the square of that
window (docs/method.md); here the window is the weight.

Of each ZOI there is a status, which says why it has a value or none, and the motion that a field predicts for the next
one.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import IntEnum
from functools import cached_property
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray


class Status(IntEnum):
    """Whether a ZOI has a value, and why not; files store the numbers."""

    OK = 0
    NOT_MEASURED = 1
    NO_PATTERN = 2
    CLIPPED = 3
    OUTSIDE = 4
    LOST = 5
    NOT_CONVERGED = 6
    POOR_MATCH = 7
    UNEVEN = 8
    AMBIGUOUS = 9

    @property
    def text(self) -> str:
        """The status in words for a person."""
        return _TEXTS[self]


_TEXTS = {
    Status.OK: "measured",
    Status.NOT_MEASURED: "not asked for (outside the mask or switched off)",
    Status.NO_PATTERN: "too little pattern to measure on",
    Status.CLIPPED: "saturated pixels: reduce exposure or light",
    Status.OUTSIDE: "moved out of the picture",
    Status.LOST: "the pattern was not found again",
    Status.NOT_CONVERGED: "the iteration did not settle",
    Status.POOR_MATCH: "the picture does not fit the reference here (crack, edge, glare or blur)",
    Status.UNEVEN: "the displacement jumps or bends inside the ZOI (crack, edge, steep strain): take smaller ZOIs",
    Status.AMBIGUOUS: "the pattern repeats, and nothing decides where this is: smaller steps between pictures",
}


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


Window = Literal["gaussian", "uniform", "tukey", "bi-triangular"]
WINDOWS: tuple[Window, ...] = get_args(Window)
TUKEY_FLANKS = 0.3
"""Share of the side of a "tukey" window that its two cosine flanks take together."""
MASK_COVERAGE = 0.99
"""A ZOI is active where at least this share of its window weight lies inside the mask."""


@dataclass(frozen=True, slots=True)
class Roi:
    """A rectangle of pixels: columns x .. x+width-1, rows y .. y+height-1 (px)."""

    x: int
    y: int
    width: int
    height: int

    def __post_init__(self) -> None:
        for name in ("x", "y", "width", "height"):
            object.__setattr__(self, name, int(getattr(self, name)))
        if self.width < 1 or self.height < 1:
            raise ValueError(f"a region of interest needs a positive width and height, got {self.text}")
        if self.x < 0 or self.y < 0:
            raise ValueError(f"a region of interest starts inside the image (x, y >= 0), got {self.text}")

    @property
    def text(self) -> str:
        """``x,y,width,height``, as it is given on the command line."""
        return f"{self.x},{self.y},{self.width},{self.height}"


@dataclass(frozen=True, eq=False, repr=False)
class ZoiGrid:
    """A regular grid of ZOIs, left- and top-aligned in a region of interest.

    ZOI (k, l) covers the columns ``roi.x + l*step .. + size-1`` and the rows
    ``roi.y + k*step .. + size-1``. Make one with ``ZoiGrid.cover``.

    Attributes
    ----------
    roi : Roi
    size, step : int, px
    active : (R, C) bool
        ZOIs to be measured; the others stay NaN with the status NOT_MEASURED.
    """

    roi: Roi
    size: int
    step: int
    active: NDArray[np.bool_]

    def __repr__(self) -> str:
        rows, columns = self.active.shape
        places = f"{self.size} px, {self.step} px apart, in x,y,w,h = {self.roi.text}"
        return f"<ZoiGrid {rows} x {columns} ZOIs of {places}; {int(self.active.sum())} active>"

    @classmethod
    def cover(
        cls,
        roi: Roi,
        size: int,
        step: int,
        mask: NDArray[np.bool_] | None = None,
        window: Window = "gaussian",
    ) -> ZoiGrid:
        """Cover a region of interest with ZOIs that lie wholly inside it.

        Parameters
        ----------
        roi : Roi
        size, step : int, px
            Side of a ZOI and distance from one to the next.
        mask : (H, W) bool, optional
            True where there is specimen. A ZOI with less than 99 % of its window weight
            there is inactive.
        window : str
            The weight that the 99 % are counted with; that of the kernel's settings.

        Raises
        ------
        ValueError
            ZOI larger than the region of interest, size < 3, step < 1, or a mask that does not
            reach over the region of interest.
        """
        size, step = int(size), int(step)
        if size < 3:
            raise ValueError(f"a ZOI needs a size of at least 3 px, got {size}")
        if step < 1:
            raise ValueError(f"the step between ZOIs is at least 1 px, got {step}")
        if size > roi.width or size > roi.height:
            raise ValueError(
                f"a ZOI of {size} px does not fit into the region of interest of "
                f"{roi.width} x {roi.height} px; make the ZOI smaller or the region larger"
            )
        shape = ((roi.height - size) // step + 1, (roi.width - size) // step + 1)
        grid = cls(roi, size, step, np.ones(shape, bool))
        return grid if mask is None else grid.subset(active=grid.coverage(mask, window) >= MASK_COVERAGE)

    def __post_init__(self) -> None:
        active = np.array(self.active, bool)
        active.flags.writeable = False
        object.__setattr__(self, "active", active)

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of ZOIs (R, C)."""
        rows, columns = self.active.shape
        return rows, columns

    @cached_property
    def first_x(self) -> NDArray[np.intp]:
        """First pixel column of each column of ZOIs, (C,), px."""
        return self.roi.x + self.step * np.arange(self.shape[1])

    @cached_property
    def first_y(self) -> NDArray[np.intp]:
        """First pixel row of each row of ZOIs, (R,), px."""
        return self.roi.y + self.step * np.arange(self.shape[0])

    @property
    def x(self) -> NDArray[np.float64]:
        """Centres, (C,), px."""
        return np.asarray(self.first_x + (self.size - 1) / 2, np.float64)

    @property
    def y(self) -> NDArray[np.float64]:
        """Centres, (R,), px."""
        return np.asarray(self.first_y + (self.size - 1) / 2, np.float64)

    def is_at(self, other: ZoiGrid) -> bool:
        """Whether the other grid has the same ZOIs, active or not."""
        mine, its = ((grid.size, grid.shape, *grid.first_x[:2], *grid.first_y[:2]) for grid in (self, other))
        return mine == its

    @property
    def n_active(self) -> int:
        """Number of ZOIs to be measured."""
        return int(np.count_nonzero(self.active))

    def weights(self, window: Window = "gaussian") -> NDArray[np.float64]:
        """The window of a ZOI, (size, size), largest value 1."""
        line = profile(window, self.size)
        return np.outer(line, line)

    def subset(self, *, every: int = 1, active: ArrayLike | None = None) -> ZoiGrid:
        """The same grid with fewer active ZOIs; its shape and positions stay as they are.

        Parameters
        ----------
        every : int
            Keep every n-th row and column of ZOIs.
        active : (R, C) bool, optional
            Keep those that are True here.

        Raises
        ------
        ValueError
            ``every`` < 1, or ``active`` of another shape than the grid.
        """
        if every < 1:
            raise ValueError(f"every must be at least 1, got {every}")
        keep = np.zeros(self.shape, bool)
        keep[::every, ::every] = True
        if active is not None:
            chosen = np.asarray(active, bool)
            if chosen.shape != self.shape:
                raise ValueError(f"active has the shape {chosen.shape}, the grid of ZOIs {self.shape}")
            keep &= chosen
        return replace(self, active=self.active & keep)

    def coverage(self, mask: NDArray[np.bool_], window: Window = "gaussian") -> NDArray[np.float64]:
        """Share of the window weight of each ZOI where the mask is True, (R, C), 0..1.

        Raises
        ------
        ValueError
            The mask does not reach over the region of interest.
        """
        inside = np.asarray(mask)
        right, bottom = self.roi.x + self.roi.width, self.roi.y + self.roi.height
        if inside.ndim != 2 or inside.shape[0] < bottom or inside.shape[1] < right:
            raise ValueError(
                f"the mask of shape {inside.shape} does not reach over the region of interest {self.roi.text}"
            )
        line = profile(window, self.size)
        line = line / line.sum()
        pixels = np.arange(self.size)
        over_x = (inside != 0)[:, self.first_x[:, None] + pixels] @ line
        return np.asarray(np.einsum("rkc,k->rc", over_x[self.first_y[:, None] + pixels], line))

    def to_dict(self) -> dict[str, Any]:
        """What a file stores of it beside ``active``; JSON values only."""
        roi = self.roi
        return {
            "roi": {"x": roi.x, "y": roi.y, "width": roi.width, "height": roi.height},
            "size": self.size,
            "step": self.step,
            "shape": list(self.shape),
        }

    @classmethod
    def from_dict(cls, description: Mapping[str, Any], active: ArrayLike | None = None) -> ZoiGrid:
        """The grid that ``to_dict`` described; all ZOIs are active unless ``active`` is given."""
        grid = cls.cover(Roi(**description["roi"]), description["size"], description["step"])
        return grid if active is None else grid.subset(active=active)


def profile(window: Window, size: int) -> NDArray[np.float64]:
    """One line through the window, (size,), largest value about 1.

    Raises
    ------
    ValueError
        Unknown window; the message lists the known ones.
    """
    x: NDArray[np.float64] = np.arange(size, dtype=np.float64) - (size - 1) / 2
    if window == "gaussian":
        return np.asarray(np.exp(-0.5 * (6 * x / size) ** 2))
    if window == "uniform":
        return np.ones(size)
    if window == "tukey":
        return _tukey(x, size)
    if window == "bi-triangular":
        return np.asarray(1 - 2 * np.abs(x) / (size + 1))
    raise ValueError(f"unknown window {window!r}; known: {', '.join(WINDOWS)}")


def _tukey(x: NDArray[np.float64], size: int) -> NDArray[np.float64]:
    flank = TUKEY_FLANKS * size / 2
    depth = np.clip((size / 2 - np.abs(x)) / flank, 0, 1)
    return np.asarray(0.5 * (1 - np.cos(np.pi * depth)))


def overlap(window: Window, size: int, step: int, count: int, moment: int) -> NDArray[np.float64]:
    """Correlation along one axis of two estimates whose ZOIs lie k steps apart, (count,).

    For white pixel noise and a pattern without direction, the noise of an estimate weighs pixels
    with x**moment w(x): moment 0 for a displacement and across a gradient, 1 along a gradient.
    """
    x = np.arange(size) - (size - 1) / 2
    kernel = x**moment * profile(window, size)
    full = np.correlate(kernel, kernel, mode="full")[size - 1 :] / (kernel @ kernel)
    lags = np.arange(count) * step
    return np.where(lags < size, full[np.minimum(lags, size - 1)], 0.0)
