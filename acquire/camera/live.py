"""A live camera: one loop over the drivers of every kind.

A kind of camera gives a ``Driver`` and what opens it; all else is here and the same for every kind: frames are numbered
and stamped, what was lost is counted, pauses are told, and a camera that stalls, fails or goes away is closed, looked
for and opened again by a thread of its own, while every step is an event. A fault never ends a test.
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Hashable, Iterator
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from acquire.camera.contract import CameraBase
from acquire.camera.timing import FrameCounter, StallWatch, StampOf, longest_pause_s, mid_exposure
from acquire.clock import Clock
from acquire.errors import DeviceError, PhasedicError, Spoken
from acquire.events import EventSink, Level, RateLimiter, device_event
from acquire.frame import CameraInfo, ClockKind, Frame
from acquire.opening import Reopening, close_within
from acquire.text import Message

log = logging.getLogger(__name__)

SLICE_S = 0.1  # longest wait between two looks at whether to stop
CLOSE_S = 0.8  # of a camera that may have died a moment ago; a thread goes on with it
DEAD = 4.0  # so many times the longest pause, and the camera is opened again


class DeviceFault(Spoken):
    """A device cannot go on as it is, and must be opened again; the text says what happened."""


@dataclass(frozen=True, slots=True, eq=False)
class Picture:
    """What a device hands over.

    Attributes
    ----------
    image : array of shape (height, width), or None
        Grey levels in memory of their own; None: no whole picture came, and its number counts as lost.
    t : float, s
        Its stamp on our clock, of the driver or of its arrival.
    number : int or None
        The device's number of the frame; None: it counts none.
    trouble : str
        Why there is no picture, or why this one is damaged: recorded, not measured. "" where all is well.
    clock : ClockKind
        Whose stamp it is.
    stamp : "start" | "end" | ""
        What of the exposure ``t`` marks; "": not known.
    arrived : float or None, s
        When it began to arrive, on our clock; None: at ``t``.
    remark : str
        A sentence to report with it.
    """

    image: NDArray[Any] | None
    t: float
    number: int | None = None
    trouble: str = ""
    clock: ClockKind = "device"
    stamp: StampOf = ""
    arrived: float | None = None
    remark: str = ""


class Driver(Protocol):
    """An open camera of some kind, set up as its address asks.

    Attributes
    ----------
    name : str
        For messages.
    info : CameraInfo
    alike : hashable
        What must be the same when it was away: who it is, and what its pictures are.
    cycle : int
        So many numbers its frames have before it begins again.
    """

    @property
    def name(self) -> str: ...

    @property
    def info(self) -> CameraInfo: ...

    @property
    def alike(self) -> Hashable: ...

    @property
    def cycle(self) -> int: ...

    def start(self) -> None:
        """Begin to stream; again: nothing. Raises DeviceFault or DeviceError."""

    def fetch(self, timeout_s: float) -> Picture | None:
        """The next picture, or None where none came in that time; raises DeviceFault. One thread calls it."""

    def close(self) -> None:
        """Give it back; idempotent, and by any thread while nobody fetches."""


Opener = Callable[[Driver | None], Driver]
"""Opens a camera: for the first time (None), or the one that was open before; raises PhasedicError or DeviceFault."""


class LiveCamera(CameraBase):
    """A camera over its driver; see ``acquire.camera.Camera``.

    Parameters
    ----------
    address : str
    opener : Opener
    on_event : callable taking an Event
    now : callable giving monotonic s

    Raises
    ------
    DeviceError, ConfigError
        It cannot be opened, or does not honour what was asked.
    """

    def __init__(
        self, address: str, opener: Opener, on_event: EventSink, now: Clock = time.monotonic
    ) -> None:
        super().__init__()
        self._address, self._opener, self._on_event, self._now = address, opener, on_event, now
        self._guard = threading.RLock()  # whoever closes must not take the buffers from under a reader
        self._driver: Driver | None = _opened(opener, address)
        self._name, self.info = self._driver.name, self._driver.info
        self._counter, self._repeats = FrameCounter(self._driver.cycle), RepeatWatch()
        self._stall, self._t, self._late = StallWatch(self._report), float("-inf"), False
        self._stale, self._not_before = 0, float("-inf")
        self._lost, self._damaged, self._why_not = RateLimiter(), RateLimiter(), ""

    def _start(self) -> None:
        if self._driver is None:
            return
        try:
            self._driver.start()
        except DeviceFault as fault:
            raise DeviceError(
                "{address}: {name} does not stream: {fault}", self._address, self._name, fault
            ) from fault
        self._stall.restart(self._now())

    def _release(self) -> None:
        with self._guard:
            driver, self._driver = self._driver, None
        if driver is not None:
            close_within(0.0 if self._stall.stalled else CLOSE_S, driver.close)

    # -- frames ---------------------------------------------------------------------------------

    def __iter__(self) -> Iterator[Frame]:
        self._start()
        self._not_before = self._now() - 2 * self._period_s
        while not self.stopped.is_set():
            try:
                frame = self._next()
            except DeviceFault as fault:
                if not self.stopped.is_set():
                    self._recover(fault.text)
            else:
                if frame is not None:
                    yield frame

    def _next(self) -> Frame | None:
        with self._guard:
            if self._driver is None:
                return None
            picture = self._driver.fetch(SLICE_S)
        now = self._now()
        if picture is None:
            if self._stall.waited(now, self._pause_s) > DEAD * self._pause_s:
                raise DeviceFault("the camera has stalled")
            return None
        self._stall.came(now)
        if picture.remark:
            self._report(picture.remark)
        arrived = picture.t if picture.arrived is None else picture.arrived
        if self._is_stale(arrived):
            return None
        self._look_for_delay(now - arrived)
        return self._frame(picture)

    def _frame(self, picture: Picture) -> Frame | None:
        if picture.image is None:
            self._counter.leave_out(picture.number)  # and count it as lost with the next one
            if count := self._lost.due(picture.t):
                why = Message(" ({trouble})", picture.trouble) if picture.trouble else ""
                self._report(
                    Message(
                        "{count} frame(s) came without a whole picture{why} and are counted as lost",
                        count,
                        why,
                    )
                )
            return None
        lost = self._count(picture)
        self._t = max(self._t, mid_exposure(picture.t, self.info.exposure_s, picture.stamp))
        info, damaged = self.info, bool(picture.trouble) or self._is_repeated(picture)
        if picture.trouble and (count := self._damaged.due(picture.t)):
            more = (
                Message(" ({trouble}; {count} since the last such line)", picture.trouble, count)
                if count > 1
                else ""
            )
            self._report(
                Message("frame {index} is damaged: recorded, not measured{more}", self._counter.index, more)
            )
        return Frame(
            picture.image, self._counter.index, self._t, picture.clock, lost, info.bits, picture.t, damaged,
            info.white_level,
        )  # fmt: skip

    def _count(self, picture: Picture) -> int:
        counted = self._counter.counts_itself
        lost = self._counter.count(picture.number, picture.t, self.info.fps, timed=picture.clock == "device")
        if remark := self._counter.pace.remark(self.info.fps):
            self._report(remark)
        if counted and not self._counter.counts_itself:
            self._report(
                Message("the driver does not number its frames; losses are counted from their stamps alone")
            )
        return lost

    def _is_repeated(self, picture: Picture) -> bool:
        """Whether a driver that numbers nothing hands out one picture again and again."""
        if picture.number is not None or picture.image is None:
            return False
        repeated = self._repeats.repeated(picture.image)
        if repeated and self._repeats.just_found:
            self._report(
                Message("the driver hands out the same picture again and again; none of them is measured")
            )
        return repeated

    def _is_stale(self, arrived: float) -> bool:
        """Frames from before the first one was asked for lay in the buffers; they are left out."""
        if arrived < self._not_before:
            self._stale += 1
            return True
        if self._stale:
            self._report(Message("{stale} frames older than the start were left out", self._stale), "info")
        self._stale, self._not_before = 0, float("-inf")
        return False

    def _look_for_delay(self, age: float) -> None:
        late = age > max(1.0, 2 * self._period_s)
        if late and not self._late:
            self._report(
                Message(
                    "frames are {age:.1f} s old when they are fetched: this machine does not keep up", age
                )
            )
        self._late = late

    @property
    def _period_s(self) -> float:
        return 1 / self.info.fps if self.info.fps else 0.1

    @property
    def _pause_s(self) -> float:
        pause = self.info.pause_s
        return longest_pause_s(self.info.fps, self.info.exposure_s) if pause is None else pause

    # -- faults ---------------------------------------------------------------------------------

    def _recover(self, why: str) -> None:
        """Close it, look for it, open it again; until it works or the test ends."""
        with self._guard:
            before, self._driver = self._driver, None
        if before is None:
            return
        # First: an open handle makes a replugged camera take another name.
        closing = close_within(SLICE_S, before.close)
        if not self._stall.stalled:
            self._report(Message("{why}; looking for it again", why), "error")

        def attempt() -> Driver:
            closing.join()
            return _opened_alike(self._opener, before)

        errors = DeviceFault, PhasedicError
        again = Reopening(attempt, lambda late: late.close(), errors, self.stopped.wait, self._not_back)
        while not self.stopped.is_set():
            if (driver := again.look()) is not None:
                self._resume(driver)
                return
        again.abandon()

    def _not_back(self, error: Exception) -> None:
        """A camera that answers and cannot be used is told, once; one that is away has been already."""
        log.debug("%s: not back yet: %s", self._address, error)
        if isinstance(error, PhasedicError) and error.text != self._why_not:
            self._why_not = error.text
            self._report(Message("it is back, but cannot be used: {error}", error), "error")

    def _resume(self, driver: Driver) -> None:
        with self._guard:
            if self._closed:
                driver.close()
                return
            self._driver = driver
        moved = Message(" as {name}", driver.name) if driver.name != self._name else ""
        if not self._stall.stalled:
            self._report(
                Message("opened again{moved}; the frames in between are counted as lost", moved), "info"
            )
        self._name, self._why_not = driver.name, ""
        self._counter.restart()
        self._stall.restart(self._now())

    def _report(self, text: str, level: Level = "warning") -> None:
        last = Message(" (last good frame {index})", self._counter.index) if level == "error" else ""
        device_event(
            self._on_event, self._address, Message("{name}: {text}{last}", self._name, text, last), level
        )


def _opened(opener: Opener, address: str) -> Driver:
    try:
        return opener(None)
    except DeviceFault as fault:
        raise DeviceError(
            "{address}: does not open: {fault}. Close other programs that use it, check cable and power, then "
            "try again",
            address,
            fault,
        ) from fault


def _opened_alike(opener: Opener, before: Driver) -> Driver:
    """The same camera with the same pictures, streaming."""
    driver = opener(before)
    try:
        if driver.alike != before.alike:
            raise DeviceError(
                "{name} came back with {alike}, not {alike2}", driver.name, driver.alike, before.alike
            )
        driver.start()
    except BaseException:
        driver.close()
        raise
    return driver


class RepeatWatch:
    """Finds a driver that hands out the same picture again and again.

    A sensor has noise: three pictures that agree in every bit are one picture.
    """

    LIMIT = 3

    def __init__(self) -> None:
        self._last: NDArray[Any] | None = None
        self.run = 0

    def repeated(self, image: NDArray[Any]) -> bool:
        """Whether this picture is the last of ``LIMIT`` or more equal ones."""
        same = self._last is not None and np.array_equal(self._last, image)
        self.run = self.run + 1 if same else 1
        self._last = image
        return self.run >= self.LIMIT

    @property
    def just_found(self) -> bool:
        """Whether the last picture was the first to count as repeated (for one message a run)."""
        return self.run == self.LIMIT
