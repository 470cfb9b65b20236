"""The settings in the address of a serial load cell: ours are taken out, pyserial gets the rest."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import cast

from acquire.addresses import Address, Options
from acquire.errors import ConfigError
from acquire.load_cell import Calibration, load_calibration
from acquire.load_sample import LoadCellInfo
from acquire.protocols.base import PROTOCOLS, Mode, Parser, Protocol, find_protocol
from acquire.protocols.units import newtons_per
from acquire.serial_line.ports import LineSettings
from acquire.text import Message


@dataclass(frozen=True, slots=True)
class SerialSettings:
    """All settings of an address.

    Attributes
    ----------
    address : str
    line : LineSettings
    protocol : Protocol
    parser : Parser
    mode : "listen" | "stream" | "poll"
    unit : str or None
        Where the line names none.
    sign : int
        1 or -1.
    gain : float or None, N per unit of the line
        None: the unit decides.
    zero : float
        Subtracted from the line's value before anything else.
    calibration : Calibration or None
        Where gain and zero come from, unless the address has them.
    capacity_N, max_step_N : float or None, N
    mass_reads_force : bool
    timeout_s : float, s
        Silence that is reported.
    wait_s : float, s
        How long opening waits for a first reading.
    rate : float, 1/s
        Of polling, or of the stream where the device lets choose.
    commands : mapping of str to bytes
    tare : "auto" | "device" | "software"
    byte_time_s : float, s
    """

    address: str
    line: LineSettings
    protocol: Protocol
    parser: Parser
    mode: Mode
    unit: str | None
    sign: int
    gain: float | None
    zero: float
    calibration: Calibration | None
    capacity_N: float | None
    max_step_N: float | None
    mass_reads_force: bool
    timeout_s: float
    wait_s: float
    rate: float
    commands: Mapping[str, bytes]
    tare: str
    byte_time_s: float


def read_settings(address: Address) -> SerialSettings:
    """The settings in ``address``.

    Raises
    ------
    ConfigError
        Names the key and what is allowed; a mass as unit without leave.
    """
    options = Options(address)
    protocol = find_protocol(options.choice("protocol", tuple(PROTOCOLS), "ascii"))
    settings = _take(options, protocol)
    if settings.gain is not None:
        return settings
    if settings.unit is not None:
        newtons_per(settings.unit, settings.mass_reads_force)
    elif not protocol.unit_on_line:
        raise ConfigError(
            "{text}: {name} sends no unit; say the one on the display, unit=N", address.text, protocol.name
        )
    return settings


def _take(options: Options, protocol: Protocol) -> SerialSettings:
    parser = protocol.make_parser(options)
    mode = options.choice("mode", ("listen", "stream", "poll"), protocol.mode)
    unit = options.text("unit")
    calibration = _calibration(options)
    gain = options.number("gain", calibration.gain if calibration else None)
    sign = _sign(options, protocol.sign if gain is None else 1, calibration)
    wire = options.flag("wire", True)
    tare = options.choice("tare", ("auto", "device", "software"), "auto")
    rate = options.number("rate", protocol.max_rate, minimum=0.01, maximum=1000)
    limits = {key: options.number(key, minimum=1e-9) for key in ("capacity", "max_step")}
    zero = options.number("zero", calibration.zero if calibration else 0.0)
    timeout_s = options.number("timeout", 2.0, minimum=0.05, maximum=3600)
    wait_s = options.number("wait", 5.0, minimum=0, maximum=3600)
    commands = _commands(options, protocol, parser, mode, rate)
    mass = options.flag("mass_reads_force")
    line = _line(options, protocol)
    return SerialSettings(
        address=options.address.text,
        line=line,
        protocol=protocol,
        parser=parser,
        mode=cast("Mode", mode),
        unit=unit,
        sign=sign,
        gain=gain,
        mass_reads_force=mass,
        commands=commands,
        tare=tare,
        byte_time_s=line.byte_time_s if wire else 0.0,
        zero=zero,
        calibration=calibration,
        capacity_N=limits["capacity"],
        max_step_N=limits["max_step"],
        timeout_s=timeout_s,
        wait_s=wait_s,
        rate=rate,
    )


def _commands(
    options: Options, protocol: Protocol, parser: Parser, mode: str, rate: float
) -> Mapping[str, bytes]:
    commands = {**protocol.commands, **parser.commands}
    if mode == "stream" and protocol.rates:
        at_least = [one for one in protocol.rates if one >= rate]
        commands["start"] = protocol.rates[min(at_least) if at_least else max(protocol.rates)]
    if mode == "poll" and "poll" not in commands:
        raise ConfigError(
            "{text}: {name} has no command to poll with; use mode=listen", options.address.text, protocol.name
        )
    return commands


def _calibration(options: Options) -> Calibration | None:
    path = options.text("calibration")
    return load_calibration(path) if path else None


def _sign(options: Options, default: int, calibration: Calibration | None) -> int:
    sign = options.text("sign")
    if sign is not None and calibration is not None:
        raise ConfigError("{text}: leave out sign=, the calibration carries it", options.address.text)
    if sign not in (None, "1", "+1", "-1"):
        raise ConfigError("{text}: sign={sign} is not possible; allowed: 1 or -1", options.address.text, sign)
    return int(sign) if sign else default


def _line(options: Options, protocol: Protocol) -> LineSettings:
    address = options.address
    baud = options.integer("baud", protocol.baud, minimum=50, maximum=12_000_000)
    bytesize = options.integer("bytesize", protocol.bytesize, minimum=5, maximum=8)
    parity = options.choice("parity", ("N", "E", "O"), protocol.parity)
    stopbits = float(options.choice("stopbits", ("1", "1.5", "2"), "1"))
    url = f"{address.scheme}:{address.target}" if address.scheme else address.target
    if not address.scheme:
        options.done()
    elif "://" not in url:
        raise ConfigError(
            "{text}: no load cell has the scheme {scheme}:; give /dev/ttyUSB0, a pyserial URL such as "
            "socket://host:port, sim:, session:run.h5 or none:",
            address.text,
            address.scheme,
        )
    rest = options.rest()
    if rest:
        url += "?" + "&".join(f"{key}={value}" for key, value in rest.items())
    return LineSettings(url, baud, bytesize, parity, stopbits, protocol.silence_s)


def describe(settings: SerialSettings, usb: str) -> LoadCellInfo:
    """The load cell of these settings, for files and screens.

    Parameters
    ----------
    settings : SerialSettings
    usb : str
        Identity of the USB device behind the port.
    """
    s, line = settings, settings.line
    return LoadCellInfo(
        address=s.address,
        name=Message("{protocol} on {port}", s.protocol.name, line.url),
        protocol=s.protocol.name,
        clock="host",
        sign=s.sign,
        capacity_N=s.capacity_N,
        settings={
            "port": line.url,
            "line": Message(
                "{baud} {bytesize}{parity}{stopbits:g}", line.baud, line.bytesize, line.parity, line.stopbits
            ),
            "mode": s.mode,
            "unit": s.unit,
            "gain": s.gain,
            "zero": s.zero,
            "calibration": None if s.calibration is None else asdict(s.calibration),
            "mass_reads_force": s.mass_reads_force,
            "max_step_N": s.max_step_N,
            "byte_time_s": s.byte_time_s,
            "usb": usb,
        },
        warnings=(s.protocol.undetected,) if s.protocol.undetected else (),
    )
