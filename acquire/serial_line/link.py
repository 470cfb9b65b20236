"""The connection to a serial port: opened, lost and opened again, without ever delaying the reader.

Opening and closing a port may take as long as a network or a driver likes. Threads of their own do both, and are
abandoned when they take too long. A peer that hangs up at once is tried more and more seldom, and reported once.
``LoadWatch`` reports silence, its end, and lines that are no readings; ``FloodWatch`` more lines than can be read.
"""

from __future__ import annotations

import dataclasses
import logging
import math
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from acquire.clock import Clock
from acquire.errors import ConfigError, DeviceError
from acquire.load_sample import LoadFlag, LoadSample
from acquire.opening import RETRY_S, Opening, Reopening, close_within
from acquire.serial_line.arrivals import Echo
from acquire.serial_line.byte_ports import Port
from acquire.serial_line.ports import PORT_ERRORS, LineSettings, find_again, identity_of
from acquire.text import Message

log = logging.getLogger(__name__)

OPEN_S = 10.0  # that the first opening may take
SELDOM_S = 8.0
STEADY_S = 5.0  # a connection that lasts so long is one
CLOSE_S = 0.5

Opener = Callable[[LineSettings], Port]
Report = Callable[[str, str], None]  # level, sentence

MAX_BAD_LINES = 10  # in a row
LATE_S = 0.05
SKIP_S = 0.25  # that a port may stay full before what waits in it is skipped
AGAIN_S = 10.0  # without a flood until it is reported anew


def close_port(port: Port | None) -> None:
    """Close a port, and wait for that no longer than half a second."""
    if port is None:
        return

    def work() -> None:
        try:
            port.close()
        except PORT_ERRORS as error:
            log.debug("closing: %s", error)

    close_within(CLOSE_S, work)


@dataclass(frozen=True, slots=True)
class LinkContext:
    """What time and ports are made of; tests bring their own.

    Attributes
    ----------
    opener : callable taking LineSettings
    clock : callable giving monotonic seconds
    stopped : threading.Event
    sleep : callable
        Waits so many seconds, less when stopped.
    """

    opener: Opener
    clock: Clock
    stopped: threading.Event
    sleep: Callable[[float], object]


class Link:
    """A port that is opened again whenever it is lost.

    Parameters
    ----------
    line : LineSettings
    context : LinkContext
    report : callable taking level and text
    last_words : callable
        Words about the last sample when the port is lost.
    echo : Echo or None
        Of what is written with ``polls``.

    Attributes
    ----------
    identity : str
        Of the USB device behind it.
    arrived : float, s
        When the last bytes came.

    Raises
    ------
    ConfigError, DeviceError
        It cannot be opened.
    """

    def __init__(
        self,
        line: LineSettings,
        context: LinkContext,
        report: Report,
        last_words: Callable[[], str] = lambda: "",
        echo: Echo | None = None,
    ) -> None:
        self._line, self._report, self._last_words = line, report, last_words
        self._echo, self.arrived = echo, -math.inf
        self._opener, self._clock = context.opener, context.clock
        self._sleep, self._stopped = context.sleep, context.stopped
        first = Opening(lambda: self._open(line), self._close)
        if not first.done(OPEN_S):
            first.abandon()
            raise DeviceError(
                "{url}: does not open within {OPEN_S:g} s; check the device and its cable", line.url, OPEN_S
            )
        self._url, port = first.take()
        self._port: Port | None = port
        self._again: Reopening[tuple[str, Port]] | None = None
        self.identity = "" if "://" in line.url else identity_of(line.url)
        self._since = context.clock()
        self._short = 0  # connections in a row that did not last
        self._missed = False  # reported as lost, and not yet as back

    @property
    def connected(self) -> bool:
        """Whether there is a port now."""
        return self._port is not None

    def receive(self, limit: int, *, wait: bool = True) -> bytes:
        """See ``Port``; b"" also when the port is lost by it; without the echo of what was written."""
        while self._port is not None:
            try:
                data = self._port.receive(limit, wait=wait)
            except PORT_ERRORS as error:
                self.lose(error)
                return b""
            if data and self._missed:
                self._heard_again()
            self.arrived = self._clock() if data else self.arrived
            if self._echo is None:
                return data
            if not data:
                return self._echo.release()
            if left := self._echo.take(data):
                return left
        return b""

    def _heard_again(self) -> None:
        if self._short < 2 or self._clock() - self._since >= STEADY_S:
            self._missed = False
            self._report(
                "info",
                Message("connected again")
                + ("" if self._url == self._line.url else Message(" as {url}", self._url)),
            )

    def write(self, data: bytes, *, polls: bool = False) -> bool:
        """Send ``data``, among polls; False where that is impossible."""
        if self._port is None:
            return False
        if polls and self._echo is not None:
            self._echo.sent(data)
        try:
            self._port.write(data)
        except PORT_ERRORS as error:
            self.lose(error)
            return False
        return True

    def lose(self, error: Exception) -> None:
        """The port is gone."""
        port, self._port = self._port, None
        if self._echo is not None:
            self._echo.release()
        close_port(port)
        if self._stopped.is_set():
            return
        now = self._clock()
        self._short = self._short + 1 if now - self._since < STEADY_S else 1
        delay = min(RETRY_S * 2 ** (self._short - 1), SELDOM_S)
        self._again = Reopening(
            lambda: self._open(self._where()),
            self._close,
            (DeviceError, ConfigError),
            self._sleep,
            lambda error: log.debug("%s", error),
            after_s=delay,
            clock=self._clock,
        )
        if self._short == 1:
            self._report(
                "error",
                Message("lost ({error}); {last_words}; trying to reach it again", error, self._last_words()),
            )
        elif self._short == 2:
            self._report(
                "error",
                Message(
                    "lost again at once ({error}): the other side hangs up; phasedic tries again ever less often "
                    "(up to every {SELDOM_S:g} s), with an event when it stays",
                    error,
                    SELDOM_S,
                ),
            )
        self._missed = True

    def again(self) -> bool:
        """Whether the lost port is back now; waits for a tenth of a second at most."""
        found = self._again.look() if self._again else None
        if found is None:
            return False
        (self._url, self._port), self._again = found, None
        self._since = self._clock()
        return True

    def _open(self, line: LineSettings) -> tuple[str, Port]:
        return line.url, self._opener(line)

    @staticmethod
    def _close(found: tuple[str, Port]) -> None:
        close_port(found[1])

    def _where(self) -> LineSettings:
        return dataclasses.replace(self._line, url=find_again(self._line.url, self.identity))

    def wake(self) -> None:
        """End a wait for bytes; from any thread."""
        port = self._port
        try:
            if port is not None:
                port.wake()
        except PORT_ERRORS as error:
            log.debug("waking a read: %s", error)

    def close(self) -> None:
        """Close the port, and the one that may be about to open."""
        if self._again is not None:
            self._again.abandon()
            self._again = None
        port, self._port = self._port, None
        close_port(port)


class LoadWatch:
    """Silence and bad lines of a stream, each reported once.

    Parameters
    ----------
    timeout_s : float, s
        Silence that is reported.
    report : callable taking level and text
    now : float, s
        When the watch begins.
    """

    def __init__(self, timeout_s: float, report: Report, now: float) -> None:
        self._timeout_s, self._report = timeout_s, report
        self._since = now
        self._last_good: LoadSample | None = None
        self._silent = self._bad_reported = False
        self._bad = 0

    def restart(self, now: float) -> None:
        """Silence counts from ``now``."""
        self._since = now

    def look(self, samples: Sequence[LoadSample], now: float) -> None:
        """Take what one read brought, nothing included."""
        good = [sample for sample in samples if not math.isnan(sample.force)]
        if samples:
            self._count_bad(samples, bool(good))
        if good:
            self._last_good, self._since, self._bad_reported = good[-1], now, False
            if self._silent:
                self._report("info", Message("readings come again"))
            self._silent = False
        elif not self._silent and now - self._since > self._timeout_s:
            self._silent = True
            self._report(
                "warning",
                Message(
                    "no reading for {timeout_s:g} s; {last_words}", self._timeout_s, self.last_words(now)
                ),
            )

    def _count_bad(self, samples: Sequence[LoadSample], any_good: bool) -> None:
        self._bad = 0 if any_good else self._bad + sum(LoadFlag.ERROR in s.flags for s in samples)
        if self._bad < MAX_BAD_LINES or self._bad_reported:
            return
        self._bad_reported = True
        shown = samples[-1].raw[:60].decode("ascii", "backslashreplace")
        text = Message("{bad} lines in a row give no reading, the last one {shown}", self._bad, repr(shown))
        self._report("warning", Message("{text}; check protocol, baud, column and decimal", text))

    def last_words(self, now: float) -> str:
        """Force and age of the last good sample."""
        good = self._last_good
        if good is None:
            return Message("there was no good sample before")
        return Message("last good sample {force:.6g} N, {now:.1f} s ago", good.force, now - good.t)


class FloodWatch:
    """When the port was last empty, and whether what it gave may have waited.

    Parameters
    ----------
    report : callable taking level and text
    now : float, s
    """

    def __init__(self, report: Report, now: float) -> None:
        self._report = report
        self._emptied, self._begun, self._reported = now, math.inf, -math.inf  # begun: the first full read
        self._more = self._late = False
        self._lines = 0

    def read(self, full: bool, lines: int, now: float) -> None:
        """A read returned; ``full`` when more may wait behind what it brought."""
        self._late = (full or self._more) and now - self._emptied > LATE_S
        self._more = full
        if not full:
            self._emptied, self._begun = now, math.inf
        elif self._begun == math.inf:
            self._begun, self._lines = now, 0
        self._lines += lines

    @property
    def late(self) -> bool:
        """Whether what was just read may have waited for more than ``LATE_S``."""
        return self._late

    def too_late(self, now: float) -> bool:
        """Whether what still waits should be skipped; reports it."""
        if now - self._begun <= SKIP_S:
            return False
        if now - self._reported > AGAIN_S:
            rate = self._lines / (now - self._begun)
            self._report(
                "warning",
                Message(
                    "lines come faster than they are read ({rate:.0f}/s); what waits is skipped and flagged STALE: "
                    "have the device send fewer",
                    rate,
                ),
            )
        self._reported = now
        return True

    def skip(self, empty: bool, now: float) -> None:
        """What waited was discarded; ``empty`` when nothing was left."""
        self._begun, self._more = math.inf, not empty
        if empty:
            self._emptied = now
