"""A load cell on a serial line: reads in bulk, stamps, scales, reconnects, and never ends a test.

The protocol's parser knows the lines, ``scaling`` the units; here is the port, its
loss and return, silence, polling, and the commands.
"""

from __future__ import annotations

import dataclasses
import logging
import math
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any, Self

from acquire.addresses import Address
from acquire.closing import Closing
from acquire.errors import ConfigError, DeviceError
from acquire.events import Event, EventKind, EventSink
from acquire.load_sample import LoadCellInfo, LoadFlag, LoadSample
from acquire.protocols import Reading
from acquire.serial_line.clock import ArrivalTimes, DeviceClock, Pace
from acquire.serial_line.ports import PORT_ERRORS, LineSettings, Port, find_again, identity_of, open_port
from acquire.serial_line.scaling import Scaling
from acquire.serial_line.settings import SerialSettings, describe, read_settings
from acquire.serial_line.watch import LoadWatch

log = logging.getLogger(__name__)

RETRY_S = 0.5

Opener = Callable[[LineSettings], Port]
Clock = Callable[[], float]


class SerialCell(Closing):
    """See ``acquire.load_cell.LoadCell``.

    Parameters
    ----------
    settings : SerialSettings
    on_event : callable taking an Event
    opener : callable
        Opens the port; for tests.
    clock : callable
        Gives monotonic seconds; for tests.
    sleep : callable or None
        Waits so many seconds, less when stopped; for tests.
    """

    def __init__(
        self,
        settings: SerialSettings,
        on_event: EventSink,
        *,
        opener: Opener = open_port,
        clock: Clock = time.monotonic,
        sleep: Callable[[float], object] | None = None,
    ) -> None:
        self._settings, self._on_event, self._opener, self._clock = settings, on_event, opener, clock
        self._stop, self._tare = threading.Event(), threading.Event()
        self._sleep = sleep or self._stop.wait
        self._busy = threading.Lock()
        self._parser = settings.parser
        self._scaling = Scaling(settings, self._tell)
        self._times, self._device, self._pace = ArrivalTimes(settings.byte_time_s), DeviceClock(), Pace()
        self._last_t = -math.inf  # of the last sample
        self._last_read = math.nan
        self._watch = LoadWatch(settings.timeout_s, self._tell, clock())
        self._next_poll = clock()
        self._awaiting = False  # an answer to a poll
        self._port: Port | None = opener(settings.line)
        self._identity = "" if "://" in settings.line.url else identity_of(settings.line.url)
        try:
            self._command("start")
            self._wait_for_first()
        except BaseException:
            self.close()
            raise
        self.info: LoadCellInfo = describe(settings, self._identity)

    def _wait_for_first(self) -> None:
        """Wait for a first good reading, since its unit decides whether this is a force at all."""
        until = self._clock() + self._settings.wait_s
        seen = 0
        while self._clock() < until and not self._stop.is_set():
            for reading in self._readings():
                seen += 1
                if not math.isnan(reading.value):
                    self._check(reading)
                    return
        if self._settings.wait_s > 0:
            what = f"{seen} lines came, none of them a reading of {self._settings.protocol.name}"
            text = f"no reading within {self._settings.wait_s:g} s: {what if seen else 'nothing came'}"
            self._tell("warning", f"{text}; check protocol, baud and cable ('phasedic identify' listens)")

    def _check(self, reading: Reading) -> None:
        try:
            self._scaling.check_unit(reading.unit or self._settings.unit or "")
        except ConfigError as error:
            shown = reading.raw.decode("ascii", "backslashreplace")
            raise ConfigError(f"{self._settings.address}: {error} (a line: {shown!r})") from error

    # -- the stream ------------------------------------------------------------------------

    def __enter__(self) -> Self:
        with self._busy:
            self._forget_input()
        return self

    def _forget_input(self) -> None:
        """What waited since the opening has no trustworthy time."""
        try:
            while self._port is not None and self._port.in_waiting:
                data = self._port.read(self._port.in_waiting)
                self._times.received(len(data), self._clock())
                self._parser.feed(data)  # it counts the bytes, so that later ones keep their times
        except PORT_ERRORS as error:
            self._lost(error)
        self._parser.restart()
        self._pace.restart()
        self._last_read = math.nan
        self._watch.restart(self._clock())

    def __iter__(self) -> Iterator[LoadSample]:
        while not self._stop.is_set():
            with self._busy:
                samples = self._pass()
            yield from samples
        self._tell_clock()
        self.close()

    def _tell_clock(self) -> None:
        """At the end: how the device's own clock went, where it has one."""
        jitter = self._device.jitter_s
        if not math.isnan(jitter):
            drift = self._device.drift
            known = "" if math.isnan(drift) else f", drift {drift * 1e6:.0f} us/s against this machine"
            self._tell("info", f"device clock: arrivals {jitter * 1e3:.1f} ms late on average (rms){known}")

    def _pass(self) -> list[LoadSample]:
        """One round: reconnect where needed, tare where asked, read what is there."""
        if self._port is None and not self._reconnect():
            return []
        if self._tare.is_set():
            self._tare.clear()
            self._do_tare()
        readings = self._readings()
        late = bool(readings) and self._pace.late(len(readings), self._last_read)
        samples = [self._sample(reading, late and reading is not readings[-1]) for reading in readings]
        self._watch.look(samples, self._clock())
        return samples

    def _readings(self) -> list[Reading]:
        """What one bulk read completes; [] on silence or when the port is lost."""
        if self._port is None:
            self._sleep(RETRY_S)
            return []
        try:
            if self._settings.mode == "poll" and not self._awaiting:
                self._poll()
            data = self._port.read(1)
            waiting = self._port.in_waiting if data else 0
            data += self._port.read(waiting) if waiting else b""
        except PORT_ERRORS as error:
            if not self._stop.is_set():
                self._lost(error)
            return []
        if not data:
            readings = self._parser.silence()
            self._awaiting = False
            return readings
        self._last_read = self._clock()
        self._times.received(len(data), self._last_read)
        readings = self._parser.feed(data)
        self._awaiting = self._awaiting and not readings
        return readings

    def _poll(self) -> None:
        """Ask for a reading when its time has come."""
        wait = self._next_poll - self._clock()
        if wait > 0:
            self._sleep(wait)
        self._command("poll")
        self._awaiting = True
        self._next_poll = (
            max(self._next_poll, self._clock() - 1 / self._settings.rate) + 1 / self._settings.rate
        )

    def _sample(self, reading: Reading, late: bool) -> LoadSample:
        t = self._times.began(reading.start)
        if reading.device_ms is not None:
            stamp = self._device.stamp(reading.device_ms, t)
            t, late = stamp.t, stamp.doubtful
            if stamp.jumped:
                self._tell("warning", "the device's own clock jumped (a restart?); its stamps are tied anew")
        self._last_t = max(t, self._last_t)
        return self._scaling.sample(reading, self._last_t, LoadFlag.STALE if late else LoadFlag.NONE)

    # -- loss and return -------------------------------------------------------------------

    def _lost(self, error: Exception) -> None:
        port, self._port = self._port, None
        self._tell(
            "error", f"lost ({error}); {self._watch.last_words(self._clock())}; trying to reach it again"
        )
        _close(port)

    def _reconnect(self) -> bool:
        url = find_again(self._settings.line.url, self._identity)
        try:
            port = self._opener(_elsewhere(self._settings.line, url))
        except (DeviceError, ConfigError) as error:
            log.debug("%s: %s", url, error)
            self._sleep(RETRY_S)
            return False
        self._port = port
        self._parser.restart()
        self._pace.restart()
        self._awaiting = False
        self._last_read = math.nan
        self._tell("info", "connected again" + ("" if url == self._settings.line.url else f" as {url}"))
        try:
            self._command("start")
        except PORT_ERRORS as error:
            self._lost(error)
        return self._port is not None

    # -- commands --------------------------------------------------------------------------

    def _command(self, name: str) -> bool:
        """Send a command of the protocol; False where it has none, or where the mode needs none."""
        data = self._settings.commands.get(name)
        if name in ("start", "stop") and self._settings.mode != "stream":
            return False
        if data is None or self._port is None:
            return False
        self._port.write(data)
        return True

    def tare(self) -> None:
        """Make the present load zero; done by the reading thread at its next round."""
        self._tare.set()

    def _do_tare(self) -> None:
        in_device = self._settings.tare == "device" or (
            self._settings.tare == "auto" and "tare" in self._settings.commands
        )
        try:
            if in_device and self._command("tare"):
                self._scaling.device_tared()
                self._event(EventKind.TARE, "info", "tare sent to the device", offset_N=None)
                return
        except PORT_ERRORS as error:
            self._lost(error)
            return
        offset = self._scaling.tare()
        if offset is None:
            self._tell("warning", "nothing to tare: there was no valid sample yet")
        else:
            self._event(EventKind.TARE, "info", f"tared: {offset:.6g} N is zero now", offset_N=offset)

    def _tell(self, level: str, text: str) -> None:
        self._event(EventKind.DEVICE, level, text)

    def _event(self, kind: EventKind, level: Any, text: str, **data: Any) -> None:
        source = self._settings.address
        self._on_event(Event(self._clock(), kind, source, text, level, data))

    # -- the end ---------------------------------------------------------------------------

    def stop(self) -> None:
        """End the iteration; from any thread."""
        self._stop.set()
        cancel = getattr(self._port, "cancel_read", None)
        if cancel is not None:
            try:
                cancel()
            except PORT_ERRORS as error:
                log.debug("cancelling a read: %s", error)

    def close(self) -> None:
        """Stop and close the port; may be called again without effect."""
        self.stop()
        with self._busy:
            port, self._port = self._port, None
            if port is not None and self._settings.mode == "stream":
                _send(port, self._settings.commands.get("stop", b""))
            _close(port)


def _elsewhere(line: LineSettings, url: str) -> LineSettings:
    return dataclasses.replace(line, url=url)


def _send(port: Port, data: bytes) -> None:
    try:
        port.write(data)
    except PORT_ERRORS as error:
        log.debug("last command: %s", error)


def _close(port: Port | None) -> None:
    if port is None:
        return
    try:
        port.close()
    except PORT_ERRORS as error:
        log.debug("closing: %s", error)


def open_serial(address: Address, on_event: EventSink) -> SerialCell:
    """Open a serial load cell: ``/dev/ttyUSB0?protocol=ascii&baud=115200&unit=N`` or a pyserial URL.

    Raises
    ------
    ConfigError
        Unknown setting or impossible value; a mass as unit without ``mass_reads_force=yes``.
    DeviceError
        The port is missing, busy or not allowed.
    """
    return SerialCell(read_settings(address), on_event)
