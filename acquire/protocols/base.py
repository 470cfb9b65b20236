"""What a protocol is: a description, a parser and the bytes of its commands; and the protocols by name."""

from __future__ import annotations

import importlib
import tomllib
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal

from acquire.addresses import Options
from acquire.errors import ConfigError
from acquire.load_sample import LoadFlag
from acquire.settings import take_settings

Mode = Literal["listen", "stream", "poll"]
Parity = Literal["N", "E", "O"]


@dataclass(frozen=True, slots=True)
class Reading:
    """One message of a device, as it stood on the line.

    Attributes
    ----------
    value : float
        In ``unit``, with the sign of the line; NaN where there is no valid value.
    unit : str or None
        None where the line names none.
    stable : bool or None
        None where the line has no such mark.
    flags : LoadFlag
    raw : bytes
        Without the line end.
    start : int
        Number of the first byte of the message, counted from the first byte ever fed.
    device_ms : float or None, ms
    """

    value: float
    unit: str | None
    raw: bytes
    start: int
    stable: bool | None = None
    flags: LoadFlag = LoadFlag.NONE
    device_ms: float | None = None


class Parser(ABC):
    """Turns bytes, in any chunking, into readings. Never raises, whatever the bytes.

    Only complete messages that match the whole grammar give values; a complete message that
    does not is a reading with flag ERROR and value NaN, so that its bytes are kept.

    Attributes
    ----------
    commands : mapping of str to bytes
        Added to those of the protocol, where they depend on settings.
    """

    commands: Mapping[str, bytes] = MappingProxyType({})

    @abstractmethod
    def feed(self, data: bytes) -> list[Reading]:
        """Take the next bytes; the readings that they complete."""

    def silence(self) -> list[Reading]:
        """Told that nothing came for a while: where no byte ends a message, silence does."""
        return []

    @abstractmethod
    def restart(self, lost: int = 0) -> None:
        """The connection was interrupted: what is half received will never be completed.

        ``lost`` bytes of it were never fed; they count for ``Reading.start``.
        """


@dataclass(frozen=True, slots=True)
class ParserSettings(ABC):
    """The settings of a protocol in an address, declared by ``acquire.settings``, and the parser that they make."""

    @abstractmethod
    def parser(self, address: str) -> Parser:
        """Their parser; raises ConfigError, which names ``address``, where they do not fit each other."""


@dataclass(frozen=True, slots=True)
class Protocol:
    """A protocol's description.

    Attributes
    ----------
    name, summary : str
    settings : type of ParserSettings
    baud, bytesize, parity : line settings where the address has none
    mode : "listen" | "stream" | "poll"
        Listen: the device sends by itself. Stream: it does after the command ``start``.
        Poll: each reading is asked for with ``poll``.
    sign : int
        With which tension is positive.
    unit_on_line : bool
        False: the address must name the unit.
    flags_overload : bool
        False: an overload shows only as a value beyond the capacity.
    commands : mapping of str to bytes
        "poll", "single", "start", "stop", "tare", "zero", "identify" as far as the device has them.
    rates : mapping of 1/s to bytes
        Commands that start a stream at these rates, where the device lets choose.
    undetected : str
        What damage of a line this protocol cannot show, for the documentation and the log.
    max_rate : float, 1/s
        Of polling, where the address has none.
    silence_s : float, s
        After which a message without an end is over.
    """

    name: str
    summary: str
    settings: type[ParserSettings]
    baud: int = 9600
    bytesize: int = 8
    parity: Parity = "N"
    mode: Mode = "listen"
    sign: int = 1
    unit_on_line: bool = True
    flags_overload: bool = True
    commands: Mapping[str, bytes] = field(default_factory=dict)
    undetected: str = ""
    max_rate: float = 10.0
    rates: Mapping[float, bytes] = field(default_factory=dict)
    silence_s: float = 0.1

    def make_parser(self, options: Options) -> Parser:
        """The parser of an address, from which it takes the settings of the protocol; raises ConfigError."""
        return take_settings(self.settings, options).parser(options.address.text)


# Imported when used; each module has a PROTOCOL.
PROTOCOLS: Mapping[str, str] = {
    "ascii": "acquire.protocols.ascii",
    "mt-sics": "acquire.protocols.mt_sics",
    "aed-standard": "acquire.protocols.aed_standard",
    "mark10": "acquire.protocols.mark10",
    "sauter": "acquire.protocols.sauter",
    "hbm-aed": "acquire.protocols.hbm_aed",
    "modbus": "acquire.protocols.modbus",
    "lines": "acquire.protocols.lines",
}


def find_protocol(name: str) -> Protocol:
    """The protocol called ``name``.

    Raises
    ------
    ConfigError
        It is unknown; lists those there are.
    """
    if name not in PROTOCOLS:
        raise ConfigError(
            "no protocol is called {name}; there are: {listed}", repr(name), ", ".join(PROTOCOLS)
        )
    protocol: Protocol = importlib.import_module(PROTOCOLS[name]).PROTOCOL
    return protocol


def table_of(what: str, name: str, ours: Path) -> dict[str, Any]:
    """A table of the file ``ours`` by its name, or a TOML file of the user's; ``what`` it is, for messages.

    Raises
    ------
    ConfigError
        There is no such table, or the file cannot be read.
    """
    known = tomllib.loads(ours.read_text(encoding="utf-8"))
    if name in known:
        return dict(known[name])
    if not name.endswith(".toml"):
        raise ConfigError(
            "no {what} is called {name}; there are: {listed}, or give a .toml file",
            *(what, repr(name), ", ".join(known)),
        )
    try:
        return tomllib.loads(Path(name).read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise ConfigError("{what} {name}: {error}", what, name, error) from error
