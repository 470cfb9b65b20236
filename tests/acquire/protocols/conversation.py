"""Parsers as the address makes them, and what their lines are worth."""

from __future__ import annotations

from acquire.addresses import Options, parse_address
from acquire.protocols.base import PROTOCOLS, Parser, Reading, find_protocol

SETTINGS = {"modbus": "profile=pt113", "lines": "preset=ohaus", "hbm-aed": "nominal=500"}


def parser(name: str, settings: str = "") -> Parser:
    """The parser of a protocol with these settings; it takes all of them."""
    options = Options(parse_address(f"/dev/ttyUSB0?{settings}" if settings else "/dev/ttyUSB0"))
    made = find_protocol(name).make_parser(options)
    options.done()
    return made


def any_parser(name: str) -> Parser:
    """With such settings as the protocol cannot do without."""
    return parser(name, SETTINGS.get(name, ""))


def read_line(name: str, line: bytes, settings: str = "") -> Reading | None:
    """What one whole line says."""
    made = parser(name, settings)
    made.feed(b"\r\n")  # the first, partial line
    readings = made.feed(line + b"\r\n")
    assert len(readings) <= 1
    return readings[0] if readings else None


ALL = list(PROTOCOLS)
