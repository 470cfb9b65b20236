"""The signals that a configuration asks for, as consumers of a live run."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack

from acquire.addresses import Options, parse_address
from acquire.serial_line import LineSettings
from live.channels import STANDARD, Readings
from live.lines import Place, read_token
from live.measure import Screen
from live.outputs import About, Consumer
from live.setup import Config
from live.signals.actions import Means, actions_of
from live.signals.alarm import Alarm
from live.signals.lines import Lines
from live.signals.strain_out import SerialOut, StrainOut, TcpOut, UdpOut
from live.signals.watch import AlarmWatch
from live.tell import Books

WHAT = "strain out"


def signals_of(about: About, books: Books, screen: Screen) -> list[Consumer]:
    """Alarms and strain out of a live run; none of a replay.

    Raises
    ------
    ConfigError, DeviceError
        A port is taken, not there, or needs a token.
    """
    if about.end is None:
        return []
    outs: list[StrainOut] = []
    with ExitStack() as opened:
        for make in (_tcp, _udp, _serial):
            out = make(about.config, _lines(about, books))
            if out is not None:
                opened.callback(out.end)
                outs.append(out)
                screen.say(out.name)
        opened.pop_all()
    means = Means(screen.bell, about.end, outs)
    alarms = [Alarm(config, actions_of(config, means)) for config in about.config.alarm]
    return [*_watch(alarms, about, books), *outs]


def _watch(alarms: Sequence[Alarm], about: About, books: Books) -> list[Consumer]:
    if not alarms:
        return []
    readings, vitals = Readings(about.start.monotonic, books.snapshot), books.vitals
    return [AlarmWatch(alarms, readings, vitals.channels, books.alarms, books.journal)]


def _lines(about: About, books: Books) -> Lines:
    config = about.config
    gauges = tuple(f"{prefix}gauge_{name}" for name in config.gauges for prefix in ("", "sigma_"))
    channels = config.strain_out.channels or (*STANDARD, *gauges)
    return Lines(Readings(about.start.monotonic, books.snapshot), channels, config.strain_out.format)


def _tcp(config: Config, lines: Lines) -> StrainOut | None:
    if config.strain_out.tcp is None:
        return None
    place = Place.parse(config.strain_out.tcp)
    return TcpOut(place.listen(WHAT), read_token(place, config.operate.token_file, WHAT), lines)


def _udp(config: Config, lines: Lines) -> StrainOut | None:
    if config.strain_out.udp is None:
        return None
    place = Place.parse(config.strain_out.udp)
    return UdpOut(place.host, place.port, lines)


def _serial(config: Config, lines: Lines) -> StrainOut | None:
    if config.strain_out.serial is None:
        return None
    address = parse_address(config.strain_out.serial)
    options = Options(address)
    baud = options.integer("baud", 115200, minimum=50, maximum=12_000_000)
    options.done()
    url = f"{address.scheme}:{address.target}" if address.scheme else address.target
    return SerialOut(LineSettings(url, baud), lines)
