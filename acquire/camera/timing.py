"""Numbers, times and pauses of a camera's frames; drivers share them. Nothing here touches a device or reads a clock.

``FrameCounter`` makes the numbers of a test from a driver's sequence numbers: never back, gaps counted. ``StallWatch``
reports a pause that is too long, and its end.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

from acquire.frame import CameraInfo, CameraSetting

StampOf = Literal["start", "end", ""]
STAMPS: tuple[StampOf, ...] = ("start", "end", "")
Bounded = tuple[float, float, float]
DEAD = 4.0  # so many times the longest pause, and the device counts as dead


def mid_exposure(raw_t: float, exposure_s: float | None, stamp: StampOf) -> float:
    """The middle of the exposure, s, where exposure and the meaning of the stamp are known.

    A stamp of the end of the frame is half an exposure late, and later by the read-out of the
    sensor, which no driver gives; without a known exposure the raw stamp stays.
    """
    if exposure_s is None or not stamp:
        return raw_t
    return raw_t + (exposure_s / 2 if stamp == "start" else -exposure_s / 2)


def missing_between(earlier_t: float, later_t: float, fps: float | None) -> int:
    """How many frames a steady camera must have lost between two stamps, by their distance.

    Parameters
    ----------
    earlier_t, later_t : float, s
    fps : float or None, 1/s
        None or 0: unknown, and 0 is returned.
    """
    if not fps:
        return 0
    return max(0, round((later_t - earlier_t) * fps) - 1)


def longest_pause_s(fps: float | None, exposure_s: float | None) -> float:
    """Time without a picture that is no fault yet: five periods and an exposure, at least half a second."""
    return max(0.5, 5 * (1 / fps if fps else 0.1) + (exposure_s or 0.0))


def missing_at_end(info: CameraInfo, silent_s: float) -> int:
    """Frames that a camera owes when a test ends ``silent_s`` after its last frame arrived; 0 within its pauses."""
    pause = info.pause_s
    if pause is None:
        pause = longest_pause_s(info.fps, info.exposure_s)
    return missing_between(0.0, silent_s, info.fps) if info.live and silent_s > pause else 0


def exposure_and_gain(
    exposure_us: Bounded | None, gain: Bounded | None, fps: float | None
) -> tuple[CameraSetting, ...]:
    """What of a camera can be changed while the picture is live: the exposure, within one picture, and the gain.

    Parameters
    ----------
    exposure_us, gain : (value, lowest, highest) or None
        None: the camera has none.
    fps : float or None, 1/s
    """
    settings = []
    if exposure_us is not None and exposure_us[0] > 0:
        value, low, high = exposure_us
        high = max(value, min(high, 1e6 / fps if fps else high))
        settings.append(CameraSetting("exposure_us", value, min(max(low, 1.0), value), high, log=True))
    if gain is not None:
        settings.append(CameraSetting("gain", gain[0], min(gain[1], gain[0]), max(gain[2], gain[0])))
    return tuple(settings)


class FrameCounter:
    """Numbers frames over the whole run, also when the driver starts again at zero.

    Parameters
    ----------
    cycle : int
        So many numbers the driver has before it begins again.

    Attributes
    ----------
    index : int
        Of the last frame; -1 before the first.
    t : float, s
        Its stamp.
    counts_itself : bool
        False once the driver's numbers have been found not to count.
    """

    def __init__(self, cycle: int = 2**32) -> None:
        self._cycle = cycle
        self.index = -1
        self.t = float("-inf")
        self.counts_itself = True
        self._sequence: int | None = None

    def restart(self) -> None:
        """The stream was opened anew: the driver's numbers begin again."""
        self._sequence = None

    def count(self, sequence: int, t: float, fps: float | None) -> int:
        """Take the next frame and give how many were lost before it.

        Parameters
        ----------
        sequence : int
            The driver's number.
        t : float, s
            Its stamp.
        fps : float or None, 1/s
            For frames lost while the device was away, found from the time that passed.
        """
        lost = self._lost(sequence, t, fps)
        if self.index < 0 and self._sequence is None:
            self.index = sequence
        else:
            self.index += 1 + lost
        self._sequence, self.t = sequence, max(t, self.t)
        return lost

    def _lost(self, sequence: int, t: float, fps: float | None) -> int:
        if self.index < 0:
            return 0
        if self._sequence is None:
            return missing_between(self.t, t, fps)
        step = (sequence - self._sequence) % self._cycle
        if 0 < step < self._cycle // 2:
            return step - 1
        self.counts_itself = False
        return missing_between(self.t, t, fps)


class StallWatch:
    """Reports once that pictures stay away, and once that they are back.

    Parameters
    ----------
    report : callable taking a text and a level

    Attributes
    ----------
    stalled : bool
    """

    def __init__(self, report: Callable[[str, Literal["info", "error"]], None]) -> None:
        self._report, self.stalled = report, False
        self._sign = self._picture = 0.0

    def restart(self, now: float) -> None:
        """The stream begins, for the first time or again."""
        self._sign = now
        if not self.stalled:
            self._picture = now

    def came(self, now: float) -> None:
        """A picture came."""
        if self.stalled:
            self.stalled = False
            self._report(f"pictures again after {now - self._picture:.1f} s", "info")
        self._sign = self._picture = now

    def waited(self, now: float, pause_s: float) -> float:
        """Seconds since the last picture or start; reported once they exceed ``pause_s``."""
        waited = now - self._sign
        if waited > pause_s and not self.stalled:
            self.stalled = True
            text = f"no picture for {waited:.1f} s; still waiting (trigger, cable, light control?)"
            self._report(text, "error")
        return waited
