"""The reference: its burst, the noise of a frame, the kernel prepared on it, and the motion during it."""

from __future__ import annotations

import contextlib
import logging
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from acquire.burst import BurstAccumulator, PictureMemory
from acquire.errors import ConfigError, DataError, MachineUnfit, PhasedicError, TooLittleMemory
from acquire.frame import Burst, Frame
from acquire.system import available_MiB
from acquire.text import Amount, Message, about, joined
from analysis.field import Status, StrainField
from analysis.quality.steadiness import strain_drifts

if TYPE_CHECKING:
    from analysis import KernelSettings, PhaseKernel, ZoiGrid

log = logging.getLogger(__name__)
BYTES_A_PIXEL, BYTES_A_ZOI = 40, 5000
"""What measuring takes at most beside the program, with a margin (measured: 34 and 3500 of 1.3 and 5 MP, order 1)."""
MIN_FOUND = 0.2  # a background of noise may be the larger part of the picture
MIN_REPEATING = 0.02
"""Share of the ZOIs from which on it is reported: some at an edge repeat along it, and their neighbours decide."""


def numerics_error(error: ValueError, what: str) -> PhasedicError:
    """An error of the numerics as one with an exit code: DataError without a pattern, else ConfigError."""
    from analysis import PatternError

    kind = DataError if isinstance(error, PatternError) else ConfigError
    return kind(about(what, error))


@contextlib.contextmanager
def on_fit_machine() -> Iterator[None]:
    """Context for making kernels: raises MachineUnfit where the machine measures a known pattern wrong."""
    from analysis import MachineError

    try:
        yield
    except MachineError as error:
        raise MachineUnfit(error.text) from error


Correction = Callable[[Burst], Burst]


def unchanged(burst: Burst) -> Burst:
    """The correction without a dark and flat frame."""
    return burst


def frame_noise(burst: Burst, stated_GL: float | None) -> float | None:
    """The noise of one frame, GL: as stated, else as measured within the burst, else None.

    A burst without any scatter (noise-free pictures) has no information on the noise.
    """
    if stated_GL is not None:
        return stated_GL
    return burst.noise if math.isfinite(burst.noise) and burst.noise > 0 else None


def averaged(noise_GL: float | None, n: int) -> float | None:
    """The noise of the mean of n frames; that of one frame is at least the quantisation noise, 1/12 GL^2."""
    return None if noise_GL is None else max(noise_GL, 12**-0.5) / math.sqrt(n)


def blank_text(burst: Burst) -> str:
    """Which picture of the burst is blank; empty where none is."""
    if not burst.blank:
        return ""
    return Message(
        "picture {blank} of {n} is blank or has less than half the contrast of another; look at light and cable",
        burst.blank,
        burst.n,
    )


def prepare(
    reference: Burst,
    grid: ZoiGrid,
    settings: KernelSettings,
    stated_noise_GL: float | None,
    correct: Correction = unchanged,
    what: str = Message("the reference"),
    steps: Sequence[float] | None = None,
) -> tuple[PhaseKernel, float | None]:
    """The kernel on ``reference``, and the noise of one frame that goes with it.

    ``steps`` are those of a compressed picture (``analysis.picture.pattern.hidden_noise``).

    Raises
    ------
    ConfigError
        The grid leaves the picture.
    DataError
        The reference, called ``what`` in the message, has no pattern, or one of its pictures is blank.
    MachineUnfit
        The machine measures a known pattern wrong.
    TooLittleMemory
        What is to be measured does not fit into the memory.
    """
    from analysis import PhaseKernel
    from analysis.picture.pattern import hidden_noise

    if why := blank_text(reference):
        raise DataError("{what}: {why}, or give --reference", what, why)
    need = _checked_memory(reference, grid)
    noise_GL = frame_noise(reference, stated_noise_GL)
    noise, sound = averaged(noise_GL, reference.n), correct(reference)
    try:
        with on_fit_machine():
            least = hidden_noise(sound.mean, steps) if steps else 0.0
            return PhaseKernel(sound.mean, grid, settings, noise, sound.clipped, least), noise_GL
    except ValueError as error:
        raise numerics_error(error, what) from error
    except MemoryError as error:
        raise need from error


def _checked_memory(reference: Burst, grid: ZoiGrid) -> TooLittleMemory:
    """The error of a kernel that does not fit, raised here where it is known before."""
    need, free = needed_MiB(reference.mean.size, grid.n_active), available_MiB()
    log.debug("the kernel takes up to %.0f MiB", need)
    found = "" if math.isnan(free) else Message(", {free:.0f} are free", free)
    error = TooLittleMemory(
        Message(
            "{n_active} ZOIs in a picture of {size:.1f} MP take about {need:.0f} MiB{found}: take a larger step "
            "or a smaller roi",
            grid.n_active,
            reference.mean.size / 1000000.0,
            need,
            found,
        )
    )
    if need > free:
        raise error
    return error


def needed_MiB(pixels: int, zois: int) -> float:
    """Memory that a kernel and its measurements take at most, beside the program."""
    return (BYTES_A_PIXEL * pixels + BYTES_A_ZOI * zois) / 2**20


def held_memory(pixels: int, zois: int) -> NDArray[np.uint8] | None:
    """Memory as a kernel and its first picture take, until they come; None where so much is not easily spared.

    The system finds it meanwhile, and gives the same again at once: new memory was up to half of the time from the
    reference to the first result (12 MP, 2 cores, November 2026).
    """
    need = needed_MiB(pixels, zois)
    return np.ones(int(need * 2**20), np.uint8) if 2 * need < available_MiB() else None


@dataclass(frozen=True, slots=True)
class ReferenceMotion:
    """The motion of the picture from one half of the reference burst to the other.

    Attributes
    ----------
    px : float, px
        The median over the ZOIs; NaN where no more than the share ``MIN_FOUND`` of the ZOIs with a pattern are found.
    strain, sigma : float
        Change of the mean exx or eyy, the larger one, and its standard uncertainty; NaN where it is not known.
    """

    px: float
    strain: float = math.nan
    sigma: float = math.nan

    @property
    def pulled(self) -> bool:
        """Whether the strain has changed: a pull moves the middle of the picture by hardly anything."""
        return strain_drifts(self.strain, self.sigma)

    @property
    def amount(self) -> str:
        """Its px, after the strain where that has changed."""
        px, strain = Message("{px:.3f}", self.px), Amount("strain", self.strain)
        return joined(", ", (strain, px)) if self.pulled else px


def motion_between(
    kernel: PhaseKernel, first: Burst, second: Burst, correct: Correction = unchanged
) -> ReferenceMotion:
    """The motion of the picture from one half of the reference burst to the other."""
    first, second = correct(first), correct(second)
    # A start without a search: a still picture has not moved, and the test can begin sooner.
    still = StrainField.from_values(kernel.grid, {})
    a = kernel.measure(first.mean, start=still, clipped=first.clipped)
    b = kernel.measure(second.mean, start=a, clipped=second.clipped)
    motion = np.hypot(b.u - a.u, b.v - a.v)
    found, usable = np.isfinite(motion), ~np.isin(a.status, (Status.NOT_MEASURED, Status.NO_PATTERN))
    if not found.sum() > MIN_FOUND * usable.sum():
        return ReferenceMotion(math.nan)
    changes = []
    for name in ("exx", "eyy"):
        (before, sigma), (after, sigma_after) = a.mean(name, found), b.mean(name, found)
        changes.append((after - before, math.hypot(sigma, sigma_after)))
    return ReferenceMotion(float(np.median(motion[found])), *max(changes, key=lambda change: abs(change[0])))


def repetition_text(period: NDArray[np.float64]) -> str:
    """What repeats and what that allows; empty where hardly any ZOI repeats.

    Parameters
    ----------
    period : (R, C) float64, px
        ``PhaseKernel.period``: NaN where a ZOI is not active, infinite where its pattern does not repeat.
    """
    from analysis.kernel.repeating import ALLOWED_PERIODS

    able, repeats = int(np.count_nonzero(~np.isnan(period))), np.isfinite(period)
    if repeats.sum() <= MIN_REPEATING * able:
        return ""
    known = period[repeats]
    return Message(
        "the pattern repeats every {typical:.1f} px in {size} of {able} ZOIs; it may move by "
        "{ALLOWED_PERIODS:.1f} px between two pictures, and to the first one",
        np.median(known),
        known.size,
        able,
        ALLOWED_PERIODS * known.min(),
    )


@dataclass(frozen=True, slots=True, eq=False)
class ReferenceBurst:
    """A reference burst, and its two halves for the check that nothing moved (none for n < 4)."""

    burst: Burst
    halves: tuple[Burst, Burst] | None


class ReferenceTaker:
    """Averages n frames as a whole and as two halves, in ``memory``."""

    def __init__(self, n: int, memory: PictureMemory | None = None) -> None:
        self._n, self._memory = n, memory
        self._whole = BurstAccumulator(n, memory=memory)
        self._half: BurstAccumulator | None = None
        self._halves: list[Burst] = []
        self._begin_half()

    def _begin_half(self) -> None:
        self._half = BurstAccumulator(self._n // 2, memory=self._memory) if self._n >= 4 else None

    def add(self, frame: Frame) -> ReferenceBurst | None:
        """Take a frame; the reference when it is complete."""
        if self._half is not None and (half := self._half.add(frame)) is not None:
            self._halves = [*self._halves[-1:], half]
        whole = self._whole.add(frame)
        if whole is None:
            return None
        pair = (self._halves[0], self._halves[1]) if len(self._halves) == 2 else None
        return ReferenceBurst(whole, pair)
