"""The simulated load cell: ``sim:?rate=80&noise_N=1``.

A simulated indicator gets the force on the specimen and sends it on a pseudo-terminal; what reads it is the
product's own serial load cell, opened on the other end. On nominal time (lock step) there is no
line: samples are computed for the whole test.
"""

from __future__ import annotations

import dataclasses
import logging
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Self

import numpy as np

from acquire.addresses import Address, Options
from acquire.errors import ConfigError
from acquire.events import Event, EventKind, EventSink, device_event
from acquire.load_cell import LoadCell, open_load_cell
from acquire.load_sample import LoadCellInfo, LoadSample
from acquire.opening import Closing
from acquire.settings import TEXT, choice, number, setting, take_settings, whole
from acquire.text import Message
from hw_mocks.indicator import AsciiIndicator, Indicator, Sensing, Style
from hw_mocks.indicator_server import IndicatorServer
from hw_mocks.sim_indicators import INDICATORS, HbmAedIndicator
from hw_mocks.sim_settings import SERIAL_FAULTS, SPECIMEN_KEYS, parse_faults
from hw_mocks.specimen import VirtualSpecimen, take_specimen

log = logging.getLogger(__name__)
STYLES: tuple[Style, ...] = ("millis", "plain", "label", "openscale")
# Settings of the product's serial reader that make sense here too.
PASSED_ON = (
    "sign", "capacity", "max_step", "timeout", "wait", "tare", "mode", "decimal", "gain", "zero", "calibration",
)  # fmt: skip
TIMED = {"millis": "1", "column": "2"}
WARNING = Message("simulated: no load cell and no specimen")


# fmt: off
@dataclass(frozen=True, slots=True)
class SimLoadSettings:
    """Settings of ``sim:``: how the simulated cell measures.

    Attributes
    ----------
    passed_on : mapping of str to str
        Settings for the serial reader.
    """

    protocol: str = setting(choice(*INDICATORS), "ascii", "that the simulated indicator speaks")
    line: Style = setting(choice(*STYLES), "millis", "what stands in a line of ascii")
    rate: float = setting(number(0.1, 1000), 80.0, "samples", "1/s")
    noise_N: float = setting(number(0), 1.0, "standard deviation of a sample", "N")
    resolution_N: float = setting(number(1e-6), 0.1, "step of the samples", "N")
    range_N: float = setting(number(1e-3), 10_000.0, "beyond which the indicator is in overload", "N")
    weight_N: float = setting(number(), 0.0, "on the cell, besides the force on the specimen", "N")
    seed: int = setting(whole(0), 0, "of the noise")
    faults: str = setting(TEXT, "", "faults and their times, such as garbage@5,silence@8*1.5")
    passed_on: Mapping[str, str] = field(default_factory=dict)
# fmt: on


class SimLoadCell(Closing):
    """The product's serial load cell on a simulated indicator; fulfils ``LoadCell``.

    Parameters
    ----------
    specimen : VirtualSpecimen
    settings : SimLoadSettings
    address : str
    on_event : callable

    Attributes
    ----------
    noise_N : float, N
        Standard deviation of one reading, rounding included: what the device adds to the truth.
    """

    def __init__(
        self, specimen: VirtualSpecimen, settings: SimLoadSettings, address: str, on_event: EventSink
    ) -> None:
        self._specimen, self._address = specimen, address
        self.noise_N = float(np.hypot(settings.noise_N, settings.resolution_N / np.sqrt(12)))
        sensing = Sensing(
            lambda t: float(specimen.force(specimen.elapsed(t))) + settings.weight_N,
            specimen.elapsed,
            settings.rate,
            settings.noise_N,
            settings.range_N,
        )
        indicator, port_settings = _indicator(settings)
        faults = parse_faults(settings.faults, SERIAL_FAULTS, address)
        self._server = IndicatorServer(indicator, sensing, seed=settings.seed, faults=faults)
        query = "&".join(f"{key}={value}" for key, value in {**port_settings, **settings.passed_on}.items())
        try:
            self._cell = open_load_cell(f"{self._server.path}?{query}", _renamed(on_event, address))
        except BaseException:
            self._server.close()
            raise
        self.info = _described(self._cell.info, address, settings, self.noise_N)

    def __enter__(self) -> Self:
        if not self._specimen.clock.claimed:
            self._specimen.clock.begin(time.monotonic())
        self._cell.__enter__()
        return self

    def __iter__(self) -> Iterator[LoadSample]:
        return iter(self._cell)

    def tare(self, *, force: bool = False) -> None:
        """As the product's serial load cell does it."""
        self._cell.tare(force=force)

    def undo_tare(self) -> None:
        """As the product's serial load cell does it."""
        self._cell.undo_tare()

    def stop(self) -> None:
        """End the iteration; from any thread."""
        self._cell.stop()

    def close(self) -> None:
        """Close the port and the indicator behind it."""
        self._cell.close()
        self._server.close()


class NominalLoadCell(Closing):
    """The load on nominal time, for lock step: as many samples as the test has, at once.

    Parameters and attributes as ``SimLoadCell``.
    """

    def __init__(
        self, specimen: VirtualSpecimen, settings: SimLoadSettings, address: str, on_event: EventSink
    ) -> None:
        self._specimen, self._settings, self._on_event = specimen, settings, on_event
        self.noise_N = float(np.hypot(settings.noise_N, settings.resolution_N / np.sqrt(12)))
        self._rng = np.random.default_rng(settings.seed)
        self._next, self._stopped, self._offset, self._last = 0, False, 0.0, 0.0
        self._before: list[float] = []
        info = LoadCellInfo(address, Message("simulated load cell on nominal time"), "none", "nominal")
        self.info = _described(info, address, settings, self.noise_N)

    def __iter__(self) -> Iterator[LoadSample]:
        while not self._stopped and self._next / self._settings.rate <= self._specimen.duration_s + 1e-9:
            t = self._next / self._settings.rate
            self._next += 1
            yield self._sample(t)

    def _sample(self, t: float) -> LoadSample:
        s = self._settings
        force = float(self._specimen.force(t)) + s.weight_N + s.noise_N * float(self._rng.standard_normal())
        self._last = round(force / s.resolution_N) * s.resolution_N
        text = f"{self._last - self._offset:.6g} N"
        start = self._specimen.clock.start or 0.0
        return LoadSample(start + t, self._last - self._offset, "N", raw=text.encode())

    def tare(self, *, force: bool = False) -> None:
        """Make the last sample zero."""
        self._before.append(self._offset)
        self._move(self._last, Message("tared: {last:.6g} N is zero now", self._last))

    def undo_tare(self) -> None:
        """As before the last tare, if there was one."""
        if self._before:
            self._move(self._before.pop(), Message("the last tare is undone"))
        else:
            device_event(self._on_event, self.info.address, Message("there is no tare to undo"), tared=False)

    def _move(self, offset: float, text: str) -> None:
        data = {"offset_N": offset, "step_N": offset - self._offset}
        self._offset = offset
        self._on_event(Event(time.monotonic(), EventKind.TARE, self.info.address, text, "info", data))

    def stop(self) -> None:
        """End the iteration; from any thread."""
        self._stopped = True

    def close(self) -> None:
        """Nothing is open."""
        self.stop()


def _indicator(settings: SimLoadSettings) -> tuple[Indicator, dict[str, str]]:
    """The indicator, and the settings that the serial reader needs."""
    name, step = settings.protocol, settings.resolution_N
    if name == "ascii":
        indicator: Indicator = AsciiIndicator(step, style=settings.line)
    elif name == "hbm-aed":
        indicator = HbmAedIndicator(step, nominal_N=settings.range_N)
    else:
        indicator = INDICATORS[name](step)
    baud, bytesize, parity = indicator.line
    port = {"protocol": name, "baud": f"{baud}", "bytesize": f"{bytesize}", "parity": parity}
    if name == "ascii":
        return indicator, port | (TIMED if settings.line in ("millis", "openscale") else {})
    more = {
        "sauter": {"unit": "N"},
        "hbm-aed": {"unit": "N", "nominal": f"{settings.range_N:g}"},
        "modbus": {"unit": "N", "profile": "laumas-tlb", "scale": f"{step:g}"},
    }
    return indicator, port | more.get(name, {})


def _described(info: LoadCellInfo, address: str, settings: SimLoadSettings, noise_N: float) -> LoadCellInfo:
    more = {
        **info.settings,
        "rate": settings.rate,
        "noise_N": noise_N,
        "resolution_N": settings.resolution_N,
        "simulated_capacity_N": settings.range_N,
        "seed": settings.seed,
    }
    name = Message("simulated load cell ({name})", info.name)
    warnings = (WARNING, *info.warnings)
    return dataclasses.replace(info, address=address, name=name, settings=more, warnings=warnings)


def _renamed(on_event: EventSink, address: str) -> Callable[[Event], None]:
    return lambda event: on_event(dataclasses.replace(event, source=address))


def open_sim_load(address: Address, on_event: EventSink, specimen: VirtualSpecimen) -> LoadCell:
    """Open ``sim:?key=value...`` on the specimen of the test.

    Its settings are those of ``SimLoadSettings``, lockstep, and of the serial reader ``PASSED_ON``. Those of the
    specimen belong to the camera's address where the camera is simulated too.

    Raises
    ------
    ConfigError
        Unknown key or fault, an impossible value, or a specimen that is not the camera's.
    """
    options = Options(address)
    _refuse_another_specimen(address, specimen)
    take_specimen(options)
    settings = take_settings(SimLoadSettings, options)
    passed_on = {key: value for key in PASSED_ON if (value := options.text(key)) is not None}
    if settings.protocol != "ascii" and "rate" in dict(options.address.settings):
        passed_on["rate"] = f"{settings.rate:g}"  # the reader asks or commands at this rate
    settings = dataclasses.replace(settings, passed_on=passed_on)
    options.done()
    parse_faults(settings.faults, SERIAL_FAULTS, address.text)  # refused in lock step too, where none happens
    kind = NominalLoadCell if specimen.nominal else SimLoadCell
    return kind(specimen, settings, address.text, on_event)


def _refuse_another_specimen(address: Address, specimen: VirtualSpecimen) -> None:
    """The camera's specimen is the only one: the load's address must agree."""
    if not specimen.clock.claimed:
        return
    given = [key for key, _ in address.settings if key in SPECIMEN_KEYS and key != "lockstep"]
    if given:
        raise ConfigError(
            "{text}: {given} belongs to the camera's sim: address, say it there", address.text, given[0]
        )
    if address.target not in ("", specimen.kind):
        raise ConfigError(
            "{text}: the camera's specimen is {kind}; say sim: alone here", address.text, specimen.kind
        )
    if Options(address).flag("lockstep", specimen.nominal) != specimen.nominal:
        raise ConfigError("{text}: camera and load must both be in lock step or neither", address.text)
