"""Numbers, times and pauses of a camera's frames; drivers share them. Nothing here touches a device or reads a clock.

``FrameCounter`` makes the numbers of a test from a driver's sequence numbers: never back, gaps counted. ``FramePace``
knows at which rate frames do come, and finds gaps without numbers. ``StallWatch`` reports a pause that is too long, and
its end.
"""

from __future__ import annotations

import statistics
from collections import deque
from collections.abc import Callable, Sequence
from typing import Literal

from acquire.frame import CameraInfo, CameraSetting
from acquire.text import Message

StampOf = Literal["start", "end", ""]
STAMPS: tuple[StampOf, ...] = ("start", "end", "")
Bounded = tuple[float, float, float]


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


def drifting(controls: Sequence[str]) -> str:
    """The warning on controls that a camera changes by itself; empty without any."""
    if not controls:
        return ""
    return Message(
        "the camera goes on changing by itself: {listed}; grey levels may drift", ", ".join(controls)
    )


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


class FramePace:
    """The rate at which a camera gives its frames, whatever its driver says: the median of the last intervals."""

    KNOWN, KEPT = 5, 20  # intervals: from which the rate is known, and of which it is the median
    # A gap is longer than so many intervals, and differs by so much from the one before
    GAP, ALIKE = 1.5, 0.25

    def __init__(self) -> None:
        self._intervals: deque[float] = deque(maxlen=self.KEPT)
        self._told = False

    @property
    def fps(self) -> float | None:
        """Frames a second that come; None until it is known."""
        return 1 / statistics.median(self._intervals) if len(self._intervals) >= self.KNOWN else None

    def missing(self, interval: float) -> int:
        """Take the interval between two frames, s, and give how many are missing in it.

        None are before the rate is known, and none where the camera goes on at another rate (automatic exposure).
        """
        before, fps = self._intervals[-1] if self._intervals else interval, self.fps
        if interval > 0:
            self._intervals.append(interval)
        if fps is None or interval * fps < self.GAP or abs(interval - before) < self.ALIKE * interval:
            return 0
        return missing_between(0.0, interval, fps)

    def remark(self, said: float | None) -> str:
        """A sentence, once, where the camera keeps another rate than its driver says, 1/s; else ""."""
        fps = self.fps
        if self._told or not said or not fps or len(self._intervals) < self.KEPT:
            return ""
        self._told = abs(fps - said) > 0.1 * said
        why = Message("little light? a shorter exposure keeps the rate")
        return (
            Message(
                "{fps:.3g} frames a second come, not the {said:.3g} of the driver ({why})", fps, said, why
            )
            if self._told
            else ""
        )


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
    pace : FramePace
    """

    def __init__(self, cycle: int = 2**32) -> None:
        self._cycle = cycle
        self.index = -1
        self.t = float("-inf")
        self.counts_itself = True
        self.pace = FramePace()
        self._sequence: int | None = None
        self._away, self._left_out = False, 0

    def leave_out(self, sequence: int | None) -> None:
        """A picture came that is handed to nobody; one without a number is counted with the next frame."""
        self._left_out += sequence is None

    def restart(self) -> None:
        """The stream was opened anew: the driver's numbers begin again."""
        self._away = True

    def count(self, sequence: int | None, t: float, fps: float | None, timed: bool = True) -> int:
        """Take the next frame and give how many were lost before it.

        Parameters
        ----------
        sequence : int or None
            The driver's number; None: it has none, and stamps alone tell.
        t : float, s
            Its stamp.
        fps : float or None, 1/s
            For frames lost while the device was away, found from the time that passed, where the rate that comes
            is not known yet.
        timed : bool
            Whether a gap between stamps means lost frames; times of arrival have gaps of their own.
        """
        lost = self._lost(sequence, t, fps, timed)
        self.index = (sequence or 0) if self.index < 0 else self.index + 1 + lost
        self._sequence, self._away, self._left_out, self.t = sequence, False, 0, max(t, self.t)
        return lost

    def _lost(self, sequence: int | None, t: float, fps: float | None, timed: bool) -> int:
        if self.index < 0:
            return 0
        if self._away:
            return missing_between(self.t, t, fps and (self.pace.fps or fps))
        if sequence is None or self._sequence is None:
            missing = self.pace.missing(max(0.0, t - self.t))
            return max(missing if timed else 0, self._left_out)
        step = (sequence - self._sequence) % self._cycle
        if 0 < step < self._cycle // 2:
            self.pace.missing((t - self.t) / step)
            return step - 1
        self.counts_itself = False
        known = step == 0 or self.pace.fps  # a number that stands still has never told anything
        missing = self.pace.missing(t - self.t)
        return missing if known else missing_between(self.t, t, fps)


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
            self._report(Message("pictures again after {now:.1f} s", now - self._picture), "info")
        self._sign = self._picture = now

    def waited(self, now: float, pause_s: float) -> float:
        """Seconds since the last picture or start; reported once they exceed ``pause_s``."""
        waited = now - self._sign
        if waited > pause_s and not self.stalled:
            self.stalled = True
            text = Message(
                "no picture for {waited:.1f} s; still waiting (trigger, cable, light control?)", waited
            )
            self._report(text, "error")
        return waited
