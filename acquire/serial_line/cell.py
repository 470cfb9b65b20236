"""A load cell on a serial line: reads in blocks, stamps, scales, and never ends nor delays a test.

The protocol's parser reads the lines, ``scaling`` converts the units, ``link`` keeps the port open; here is the
stream of samples, polling, and the commands. Every round is bounded in time and bytes, whatever comes.
"""

from __future__ import annotations

import logging
import math
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any, Self

from acquire.addresses import Address
from acquire.clock import Clock, ClockUnit, DeviceClock
from acquire.errors import ConfigError
from acquire.events import Event, EventKind, EventSink
from acquire.load_sample import LoadCellInfo, LoadFlag, LoadSample
from acquire.opening import Closing
from acquire.protocols.base import Reading
from acquire.serial_line.arrivals import ArrivalRate, ArrivalTimes, Echo, in_milliseconds
from acquire.serial_line.link import FloodWatch, Link, LinkContext, LoadWatch, Opener
from acquire.serial_line.ports import open_port
from acquire.serial_line.scaling import Scaling
from acquire.serial_line.settings import SerialSettings, describe, read_settings
from acquire.text import Message, counts

log = logging.getLogger(__name__)

BLOCK = 2048  # bytes of one round
REST_S = 0.05  # between two rounds at most
# The bytes before a test are discarded within half a second, those of a flood in a moment.
START_S, FLOOD_S, DISCARD_BYTES, DISCARD_BLOCK = 0.5, 0.05, 1 << 22, 1 << 16
REFILL_S, FULL_BYTES = 0.002, 2048  # a USB adapter whose buffer was full sends the rest after a moment
ANSWER_S = 1.0  # that an answer may take from its first byte to its last
TARE_S = 0.3  # that a device may take to tare
FORCED, UNDO = "force", "undo"


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
        self._settings, self._on_event, self._clock = settings, on_event, clock
        self._stop = threading.Event()
        self._tare: str | None = None  # requested: "", FORCED or UNDO
        self._sleep = sleep or self._stop.wait
        self._busy = threading.Lock()
        self._parser = settings.parser
        self._scaling = Scaling(settings, self._report)
        self._times, self._pace = ArrivalTimes(settings.byte_time_s), ArrivalRate()
        self._device, self._unit = DeviceClock(), ClockUnit()  # of the device's own time, where it sends one
        self._last_t = -math.inf  # of the last sample
        self._last_read = math.nan
        self._watch, self._flood = (
            LoadWatch(settings.given.timeout, self._report, clock()),
            FloodWatch(self._report, clock()),
        )
        self._next_poll, self._polled = clock(), math.nan  # when the poll was sent whose answer is awaited
        self._taring_until = -math.inf
        self._skipped = 0  # bytes, in floods
        self._waited = True  # for the bytes of the last round
        context = LinkContext(opener, clock, self._stop, self._sleep)
        echo = Echo(self._parser, self._report) if settings.mode == "poll" else None
        self._link = Link(settings.line, context, self._report, lambda: self._watch.last_words(clock()), echo)
        try:
            self._command("start")
            self._wait_for_first()
        except BaseException:
            self.close()
            raise
        self.info: LoadCellInfo = describe(settings, self._link.identity)

    def _wait_for_first(self) -> None:
        """Wait for a first good reading, since its unit decides whether this is a force at all."""
        until = self._clock() + self._settings.given.wait
        seen = 0
        while self._clock() < until and not self._stop.is_set():
            if not self._link.connected and not self._reconnect():
                continue
            for reading in self._readings():
                seen += 1
                if not math.isnan(reading.value):
                    self._check(reading)
                    return
        if self._settings.given.wait > 0:
            what = Message(
                "{seen} lines came, none of them a reading of {name}", seen, self._settings.protocol.name
            )
            text = Message(
                "no reading within {wait_s:g} s: {what}",
                self._settings.given.wait,
                what if seen else Message("nothing came"),
            )
            self._report(
                "warning",
                Message("{text}; check protocol, baud and cable ('phasedic identify' listens)", text),
            )

    def _check(self, reading: Reading) -> None:
        try:
            self._scaling.check_unit(reading.unit or self._settings.given.unit or "")
        except ConfigError as error:
            shown = reading.raw.decode("ascii", "backslashreplace")
            raise ConfigError(
                "{address}: {error} (a line: {shown})", self._settings.address, error, repr(shown)
            ) from error

    # -- the stream ------------------------------------------------------------------------

    def __enter__(self) -> Self:
        """What waited since the opening has no trustworthy time."""
        with self._busy:
            self._discard_waiting(START_S)
            self._restart_stream()
            self._watch.restart(self._clock())
        return self

    def _discard_waiting(self, seconds: float) -> int:
        """Discard what waits, until the port was empty twice or time is up; the number of bytes."""
        until, count, empty = self._clock() + seconds, 0, 0
        while empty < 2 and count < DISCARD_BYTES and self._clock() < until and not self._stop.is_set():
            data = self._link.receive(DISCARD_BLOCK, wait=False)
            count, empty = count + len(data), 0 if data else empty + 1
            if empty == 1 and count >= FULL_BYTES:
                self._sleep(REFILL_S)
        if count:
            self._times.received(count, self._clock())
        self._parser.restart(count)
        self._flood.skip(empty > 0, self._clock())
        return count

    def _restart_stream(self) -> None:
        """Forget the pace of the stream: another one begins."""
        self._pace.restart()
        self._polled = self._last_read = math.nan

    def __iter__(self) -> Iterator[LoadSample]:
        while not self._stop.is_set():
            with self._busy:
                samples = self._pass()
            yield from samples
        self._report_end()
        self.close()

    def _report_end(self) -> None:
        """How the device's own clock went, where it has one, and what was never looked at."""
        jitter = self._device.jitter_s
        if not math.isnan(jitter):
            drift = self._device.drift
            known = (
                ""
                if math.isnan(drift)
                else Message(", drift {drift:.0f} us/s against this machine", drift * 1e6)
            )
            self._report(
                "info",
                Message(
                    "load times are those of the device's clock; readings came {jitter:.1f} ms late (rms){known}",
                    jitter * 1e3,
                    known,
                ),
            )
        if self._skipped:
            self._report(
                "warning",
                Message(
                    "{skipped} bytes were skipped, since lines came faster than they are read",
                    *counts(self._skipped),
                ),
            )

    def _pass(self) -> list[LoadSample]:
        """One round: reconnect where needed, tare where asked, read what is there."""
        if not self._link.connected and not self._reconnect():
            self._watch.look((), self._clock())
            return []
        samples = self._tare_requested()
        readings = self._readings()
        samples += self._samples(readings)
        if self._flood.too_late(self._clock()):
            self._skipped += self._discard_waiting(FLOOD_S)
            self._pace.restart()
            samples.append(self._hole())
        self._watch.look(samples, self._clock())
        return samples

    def _reconnect(self) -> bool:
        if not self._link.again():
            return False
        self._parser.restart()
        self._restart_stream()
        self._flood.skip(True, self._clock())
        self._command("start")
        return self._link.connected

    def _readings(self) -> list[Reading]:
        """What one block completes; [] on silence or when the port is lost."""
        if self._settings.mode == "poll" and math.isnan(self._polled):
            self._poll()
        self._rest()
        began = self._clock()
        data = self._link.receive(BLOCK)
        self._last_read = self._link.arrived if data else self._clock()
        self._waited = self._last_read - began > 1e-3
        readings = self._feed(data)
        if not data or self._last_read - self._polled > ANSWER_S:
            self._polled = math.nan
            readings += self._parser.silence()
        return readings

    def _feed(self, data: bytes) -> list[Reading]:
        if data:
            self._times.received(len(data), self._last_read)
        readings = self._parser.feed(data)
        self._flood.read(len(data) >= BLOCK, len(readings), self._last_read)
        self._polled = math.nan if readings else self._polled
        return readings

    def _rest(self) -> None:
        """As long as the last round took where bytes were there already: a flood must not keep the others out."""
        busy = 0.0 if self._waited else self._clock() - self._last_read
        if busy > 1e-3:
            self._sleep(min(busy, REST_S))

    def _poll(self) -> None:
        """Ask for a reading when its time has come."""
        wait = self._next_poll - self._clock()
        if wait > 0:
            self._sleep(wait)
        self._command("poll")
        period, self._polled = 1 / self._settings.rate, self._clock()
        self._next_poll = max(self._next_poll, self._polled - period) + period

    def _samples(self, readings: list[Reading]) -> list[LoadSample]:
        if not readings:
            return []
        times = [self._times.began(reading.start) for reading in readings]
        arrived = math.nan if self._flood.late else times[-1]
        readings, told = in_milliseconds(self._unit, readings, arrived)
        if told:
            self._report("warning", told)
            self._device = DeviceClock()
        stamps = [(r.device_ms, t) for r, t in zip(readings, times, strict=True) if r.device_ms is not None]
        waited = self._flood.late
        if not waited:  # messages of unknown age cannot tie the device's clock
            self._device.begin(stamps)
        if waited or self._last_read < self._taring_until:
            self._pace.restart()
            late = [True] * len(times)
        elif self._settings.mode == "poll":
            late = [True] * (len(times) - 1) + [False]
        else:
            late = self._pace.late(times)
        return [self._sample(*one) for one in zip(readings, times, late, strict=True)]

    def _sample(self, reading: Reading, t: float, late: bool) -> LoadSample:
        if reading.device_ms is not None and self._device.tied:
            stamp = self._device.stamp(reading.device_ms, t)
            t, late = stamp.t, stamp.doubtful
            if stamp.jumped:
                self._report(
                    "warning", Message("the device's own clock jumped (a restart?); its stamps are tied anew")
                )
        self._last_t = max(t, self._last_t)
        return self._scaling.sample(reading, self._last_t, LoadFlag.STALE if late else LoadFlag.NONE)

    def _hole(self) -> LoadSample:
        """A gap: forces are never interpolated across it."""
        self._last_t = max(self._clock(), self._last_t)
        return LoadSample(self._last_t, math.nan, self._settings.given.unit or "", flags=LoadFlag.STALE)

    # -- commands --------------------------------------------------------------------------

    def _command(self, name: str) -> bool:
        """Send a command of the protocol; False where it has none, or where the mode needs none."""
        data = self._settings.commands.get(name)
        if data is None or (name in ("start", "stop") and self._settings.mode != "stream"):
            return False
        return self._link.write(data, polls=self._settings.mode == "poll")

    def tare(self, *, force: bool = False) -> None:
        """Make the present load zero; done, or refused, by the reading thread at its next round."""
        self._tare = FORCED if force else ""

    def undo_tare(self) -> None:
        """Let zero be where it was before the last tare; done by the reading thread."""
        self._tare = UNDO

    def _tare_requested(self) -> list[LoadSample]:
        """Apply a requested tare; forces are never interpolated across it."""
        request, self._tare = self._tare, None
        if request is None:
            return []
        moved = self._undo() if request == UNDO else self._tare_now(request == FORCED)
        if moved:
            self._scaling.tared()
        return [self._hole()] if moved else []

    def _tare_now(self, force: bool) -> bool:
        zero = self._scaling.zero
        why_not = zero.why_not(self._clock())
        if why_not and not force:
            self._refuse(Message("not tared: {why_not}; hold the load still, or force the tare", why_not))
            return False
        load, data = zero.load(), {"forced": bool(why_not), "undo": False}
        wanted = self._settings.given.tare
        can = wanted == "device" or (wanted == "auto" and "tare" in self._settings.commands)
        if can and self._command("tare"):
            self._taring_until = self._clock() + TARE_S
            step = zero.moved_in_device()
            text = Message("tare sent to the device under {load:.6g} N", load)
            self._event(EventKind.TARE, "info", text, offset_N=None, step_N=_known(step), **data)
            return True
        if math.isnan(load):
            self._refuse(Message("nothing to tare: there was no valid sample yet"))
            return False
        step = zero.take()
        text = Message("tared: {load:.6g} N is zero now", load)
        self._event(EventKind.TARE, "info", text, offset_N=zero.offset, step_N=step, **data)
        return True

    def _undo(self) -> bool:
        zero = self._scaling.zero
        step = zero.undo()
        if step is None:
            self._refuse(Message("there is no tare to undo"))
            return False
        text = Message("the last tare is undone: forces rise by {step:.6g} N", -step)
        data = {"offset_N": zero.offset, "step_N": step, "forced": False, "undo": True}
        self._event(EventKind.TARE, "info", text, **data)
        return True

    def _refuse(self, text: str) -> None:
        self._event(EventKind.DEVICE, "warning", text, tared=False)

    def _report(self, level: str, text: str) -> None:
        self._event(EventKind.DEVICE, level, text)

    def _event(self, kind: EventKind, level: Any, text: str, **data: Any) -> None:
        source = self._settings.address
        self._on_event(Event(self._clock(), kind, source, text, level, data))

    # -- the end ---------------------------------------------------------------------------

    def stop(self) -> None:
        """End the iteration; from any thread."""
        self._stop.set()
        self._link.wake()

    def close(self) -> None:
        """Stop and close the port; idempotent."""
        self.stop()
        with self._busy:
            self._command("stop")
            self._link.close()


def _known(value: float) -> float | None:
    return None if math.isnan(value) else value


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
