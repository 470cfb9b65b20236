"""The settings in the address of a serial load cell: ours are taken out, pyserial gets the rest."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import cast

from acquire.addresses import Address, Options, parse_address
from acquire.bounds import NotAllowed
from acquire.errors import ConfigError
from acquire.load_cell import Calibration, load_calibration
from acquire.load_sample import LoadCellInfo
from acquire.protocols.base import PROTOCOLS, Mode, Parser, Protocol, find_protocol, newtons_per
from acquire.serial_line.ports import LineSettings
from acquire.settings import FLAG, TEXT, choice, number, setting, take_settings, whole
from acquire.text import Message

USUAL = "of the line; where not given as usual with the protocol"
UNITS = "of lines without one: N (newton), kN, mN, daN, kgf, gf, lbf, ozf; masses kg, g, mg, t, lb, oz"
_OF_SCALING = (
    "gain", "zero", "sign", "unit", "calibration", "capacity", "max_step", "mass_reads_force", "tare", "timeout",
    "wait", "wire",
)  # fmt: skip
"""Settings on which the value on the line does not depend."""
MODES = "listen: it sends by itself; stream: after a command; poll: each reading is asked for; else as usual"


def _sign(word: str) -> int:
    if word not in ("1", "+1", "-1"):
        raise NotAllowed("1 or -1")
    return int(word)


# fmt: off
@dataclass(frozen=True, slots=True)
class SerialOptions:
    """Of a serial load cell, whatever its protocol."""

    protocol: str = setting(choice(*PROTOCOLS), "ascii", "what the device speaks")
    baud: int | None = setting(whole(50, 12_000_000), None, USUAL, "1/s")
    bytesize: int | None = setting(whole(5, 8), None, USUAL, "bit")
    parity: str | None = setting(choice("N", "E", "O"), None, USUAL)
    stopbits: str = setting(choice("1", "1.5", "2"), "1", "of the line")
    unit: str | None = setting(TEXT, None, UNITS)
    mass_reads_force: bool = setting(FLAG, False, "kg stand for a force, 1 kg for 9.80665 N; otherwise refused")
    sign: int | None = setting(_sign, None, "-1 where compression reads positive: tension is positive in every result")
    capacity: float | None = setting(number(1e-9), None, "samples beyond it are flagged", "N")
    max_step: float | None = setting(number(1e-9), None, "a larger step between samples is flagged STEP", "N")
    gain: float | None = setting(number(), None, "force = (value - zero) * gain, instead of a unit", "N")
    zero: float | None = setting(number(), None, "value at no load; where not given that of calibration, or 0")
    calibration: str | None = setting(TEXT, None, "a file of phasedic load-calibrate, with gain, zero and sign")
    mode: str | None = setting(choice("listen", "stream", "poll"), None, MODES)
    rate: float | None = setting(number(0.01, 1000), None, "of polling, or of an adjustable stream", "1/s")
    tare: str = setting(choice("auto", "device", "software"), "auto", "where it is made; auto: in the device if it can")
    timeout: float = setting(number(0.05, 3600), 2.0, "silence that is reported", "s")
    wait: float = setting(number(0, 3600), 5.0, "for a first reading at the start", "s")
    wire: bool = setting(FLAG, True, "transmission times are subtracted; no: a USB device whose speed has no meaning")
# fmt: on


@dataclass(frozen=True, slots=True)
class SerialSettings:
    """All settings of an address.

    Attributes
    ----------
    address : str
    given : SerialOptions
    line : LineSettings
    protocol : Protocol
    parser : Parser
    mode : "listen" | "stream" | "poll"
    sign : int
        1 or -1.
    gain : float or None, N per unit of the line
        None: the unit decides.
    zero : float
        Subtracted from the line's value before anything else.
    calibration : Calibration or None
        Where gain and zero come from, unless the address has them.
    rate : float, 1/s
        Of polling, or of the stream where the device lets choose.
    commands : mapping of str to bytes
    byte_time_s : float, s
    """

    address: str
    given: SerialOptions
    line: LineSettings
    protocol: Protocol
    parser: Parser
    mode: Mode
    sign: int
    gain: float | None
    zero: float
    calibration: Calibration | None
    rate: float
    commands: Mapping[str, bytes]
    byte_time_s: float


def read_settings(address: Address) -> SerialSettings:
    """The settings in ``address``.

    Raises
    ------
    ConfigError
        Names the key and what is allowed; a mass as unit without leave.
    """
    options = Options(address)
    given = take_settings(SerialOptions, options)
    protocol = find_protocol(given.protocol)
    parser = protocol.make_parser(options)
    calibration = load_calibration(given.calibration) if given.calibration else None
    if calibration is not None and given.sign is not None:
        raise ConfigError("{text}: leave out sign=, the calibration carries it", address.text)
    gain, zero = given.gain, given.zero
    if calibration is not None:
        gain = calibration.gain if gain is None else gain
        zero = calibration.zero if zero is None else zero
    if gain is None and given.unit is not None:
        newtons_per(given.unit, given.mass_reads_force)
    elif gain is None and not protocol.unit_on_line:
        raise ConfigError(
            "{text}: {name} sends no unit; say the one on the display, unit=N", address.text, protocol.name
        )
    mode = protocol.mode if given.mode is None else given.mode
    rate = protocol.max_rate if given.rate is None else given.rate
    line = _line(options, given, protocol)
    return SerialSettings(
        address=address.text,
        given=given,
        line=line,
        protocol=protocol,
        parser=parser,
        mode=cast("Mode", mode),
        sign=given.sign or (protocol.sign if gain is None else 1),
        gain=gain,
        zero=0.0 if zero is None else zero,
        calibration=calibration,
        rate=rate,
        commands=_commands(address, protocol, parser, mode, rate),
        byte_time_s=line.byte_time_s if given.wire else 0.0,
    )


def _commands(
    address: Address, protocol: Protocol, parser: Parser, mode: str, rate: float
) -> Mapping[str, bytes]:
    commands = {**protocol.commands, **parser.commands}
    if mode == "stream" and protocol.rates:
        at_least = [one for one in protocol.rates if one >= rate]
        commands["start"] = protocol.rates[min(at_least) if at_least else max(protocol.rates)]
    if mode == "poll" and "poll" not in commands:
        raise ConfigError(
            "{text}: {name} has no command to poll with; use mode=listen", address.text, protocol.name
        )
    return commands


def _line(options: Options, given: SerialOptions, protocol: Protocol) -> LineSettings:
    address = options.address
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
    return LineSettings(
        url,
        given.baud or protocol.baud,
        given.bytesize or protocol.bytesize,
        given.parity or protocol.parity,
        float(given.stopbits),
        protocol.silence_s,
    )


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
        capacity_N=s.given.capacity,
        settings={
            "port": line.url,
            "line": Message(
                "{baud} {bytesize}{parity}{stopbits:g}", line.baud, line.bytesize, line.parity, line.stopbits
            ),
            "mode": s.mode,
            "unit": s.given.unit,
            "gain": s.gain,
            "zero": s.zero,
            "calibration": None if s.calibration is None else asdict(s.calibration),
            "mass_reads_force": s.given.mass_reads_force,
            "max_step_N": s.given.max_step,
            "byte_time_s": s.byte_time_s,
            "usb": usb,
        },
        warnings=tuple(one for one in (s.protocol.undetected, _calibrated_otherwise(s)) if one),
    )


def _calibrated_otherwise(settings: SerialSettings) -> str:
    """Whether the calibration was made with another port or other settings, on which the gain may depend."""
    if settings.calibration is None or not settings.calibration.address:
        return ""
    then, now = (
        {"port": one.target, "protocol": "ascii"}
        | {key: value for key, value in one.settings if key not in _OF_SCALING}
        for one in map(parse_address, (settings.calibration.address, settings.address))
    )
    other = sorted(key for key in then.keys() | now.keys() if then.get(key) != now.get(key))
    if not other:
        return ""
    return Message(
        "calibrated with other settings ({other}), as {address}: hang a known load on it, forces may be wrong by a "
        "factor",
        ", ".join(other),
        settings.calibration.address,
    )
