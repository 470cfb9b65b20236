"""What is sent to devices, byte by byte, what a protocol's settings may be, and where messages stand."""

from __future__ import annotations

import math
from typing import Any

import pytest

from acquire.errors import ConfigError
from acquire.load_sample import LoadFlag
from acquire.protocols.base import PROTOCOLS, find_protocol
from acquire.protocols.buffers import HeldBytes, Line, LineBuffer, number
from acquire.protocols.modbus import ModbusParser, frame, load_profile, profile_from
from tests.acquire.protocols.conversation import any_parser, parser, read_line

COMMANDS: dict[str, dict[str, bytes]] = {
    "ascii": {},
    "lines": {},
    "mt-sics": {
        "poll": b"SI\r\n", "single": b"SI\r\n", "start": b"SIR\r\n", "stop": b"SI\r\n",
        "tare": b"TI\r\n", "zero": b"ZI\r\n", "identify": b"I4\r\n",
    },
    "aed-standard": {
        "poll": b"Q\r\n", "single": b"Q\r\n", "start": b"SIR\r\n", "tare": b"T\r\n", "zero": b"Z\r\n",
    },
    "mark10": {
        "poll": b"?C\r", "single": b"?C\r", "start": b"AOUT10\r", "stop": b"AOUT0\r",
        "tare": b"Z\r", "zero": b"Z\r", "identify": b"LIST\r",
    },
    "sauter": {"poll": b"9", "single": b"9"},
    "hbm-aed": {
        "poll": b"MSV?;", "single": b"MSV?;", "start": b"MSV?0;", "stop": b"STP;", "tare": b"TAR;",
        "identify": b"IDN?;",
    },
    "modbus": {},
}  # fmt: skip


@pytest.mark.parametrize("name", PROTOCOLS)
def test_commands_are_those_of_the_manual(name: str) -> None:
    protocol = find_protocol(name)
    assert protocol.name == name and protocol.commands == COMMANDS[name]
    ended_by_silence = name in ("sauter", "modbus")
    assert (protocol.silence_s, protocol.max_rate) == (0.05 if ended_by_silence else 0.1, 10.0)


def test_a_query_of_modbus_spans_value_and_status() -> None:
    assert any_parser("modbus").commands == dict.fromkeys(("poll", "single"), frame(1, 3, words=(0, 3)))
    laumas = parser("modbus", "profile=laumas-tlb").commands["poll"]
    assert laumas == bytes([1, 3, 0, 7, 0, 2]) + bytes.fromhex("75CA")


def test_presets_that_are_asked_have_their_commands() -> None:
    assert parser("lines", "preset=loadstar").commands == {
        "poll": b"\r", "start": b"O0W0\r", "tare": b"CT0\r",
    }  # fmt: skip
    assert parser("lines", "preset=dillon").commands == {"poll": b"l", "zero": b"z"}


@pytest.mark.parametrize(
    ("name", "settings", "words"),
    [
        ("ascii", "column=0", "column=0 is not possible; allowed: a whole number from 1 to 64"),
        ("ascii", "millis=65", "millis=65 is not possible; allowed: a whole number from 1 to 64"),
        ("ascii", "decimal=dot", "decimal=dot is not possible; allowed: one of point, comma"),
        ("aed-standard", "digits=17", "allowed: a whole number from 1 to 16"),
        ("aed-standard", "decimal=", "allowed: one of point, comma"),
        ("hbm-aed", "decimals=9", "allowed: a whole number from 0 to 8"),
        ("hbm-aed", "nominal=0", "allowed: a number from 1e-12"),
        ("hbm-aed", "nominal=5&decimals=1", "give nominal or decimals, not both"),
        ("modbus", "profile=pt113&scale=0", "scale=0 is not possible; allowed: a number other than zero"),
        (
            "lines",
            "pattern=(?P<value>.+)&ends=crlf",
            "ends=crlf is not possible; allowed: one of line, cr, lf, etx",
        ),
        (
            "lines",
            "pattern=(?P<value>.+)&decimal=dot",
            "decimal=dot is not possible; allowed: one of point, comma",
        ),
        ("modbus", "scale=2", "needs profile=, for example laumas-tlb"),
    ],
)
def test_settings_beyond_their_bounds_are_refused(name: str, settings: str, words: str) -> None:
    with pytest.raises(ConfigError) as caught:
        parser(name, settings)
    assert words in str(caught.value)


@pytest.mark.parametrize(
    ("name", "settings", "line", "value"),
    [
        ("ascii", "column=1", b"1.5,234.5", 1.5),  # a second point: no thousands
        ("ascii", "column=1", b"12N,345.5", 12.0),  # a unit between them: no thousands
        ("ascii", "column=1", b"1234,345.5", 1234.0),  # four digits before: no thousands
        ("ascii", "column=1", b"12,-345.5", 12.0),
        ("ascii", "column=1&decimal=comma", b"1;234,5", 1.0),
        ("ascii", "millis=2&column=1", b"12,345", 12.0),
        ("hbm-aed", "decimals=8", b"+0500000", 0.005),
        ("hbm-aed", "nominal=200", b"-1000000", -200.0),
        ("lines", "preset=loadstar", b"-500", -0.5),
        ("mt-sics", "", b"S S     100.00 xyz", math.nan),
        ("mt-sics", "", b"S S     100.00", math.nan),
        ("ascii", "", b"1 N 2 N", math.nan),
        ("ascii", "", b"12.5 N 3", 12.5),
    ],
)
def test_what_a_line_is_worth(name: str, settings: str, line: bytes, value: float) -> None:
    reading = read_line(name, line, settings)
    assert reading is not None and reading.value == pytest.approx(value, nan_ok=True)
    assert (LoadFlag.ERROR in reading.flags) == math.isnan(value)


@pytest.mark.parametrize(("length", "value"), [(256, 12.5), (257, math.nan)])
def test_a_line_has_at_most_256_bytes(length: int, value: float) -> None:
    reading = read_line("ascii", b"12.5 N".rjust(length))
    assert reading is not None and reading.value == pytest.approx(value, nan_ok=True)
    assert len(reading.raw) == 256


def test_what_comes_after_an_endless_line_in_pieces_stands_where_it_says() -> None:
    buffer = LineBuffer(limit=8, drop_first=False)
    assert buffer.feed(b"1234567") == []
    assert buffer.feed(b"89abc\nxy\n") == [Line(b"12345678", 0, whole=False), Line(b"xy", 13)]


def test_bytes_held_are_counted_from_the_first_ever() -> None:
    held = HeldBytes(8)
    held.add(b"abc")
    held.add(b"defghijk")
    assert held.take(2) == (b"ab", 0) and held.take(99) == (b"cdefgh", 2)
    held.add(b"xyz")
    assert held.take(1) == (b"x", 11)
    held.clear(lost=100)
    held.add(b"1")
    assert held.take(1) == (b"1", 114)


def test_two_answers_of_modbus_stand_one_behind_the_other() -> None:
    made, answer = any_parser("modbus"), frame(1, 3, 6, words=(0, 5, 2))
    assert [(r.value, r.start) for r in made.feed(answer + answer)] == [(5.0, 0), (5.0, 11)]


@pytest.mark.parametrize("text", ["nan", "inf", "1_000", "0x10", "1e999", "--5", "+", "1e", "", " ", "5 5"])
def test_what_no_device_sends_is_no_number(text: str) -> None:
    assert math.isnan(number(text))


@pytest.mark.parametrize(
    ("text", "value"), [("- 5", -5.0), (" +  1.5 ", 1.5), (".5", 0.5), ("1.5e-3", 1.5e-3)]
)
def test_a_sign_may_stand_apart(text: str, value: float) -> None:
    assert number(text) == value


# -- register maps ----------------------------------------------------------------------------


def test_a_map_that_says_but_its_register_is_the_usual_one() -> None:
    profile = profile_from({"value": {"register": 7}}, "test")
    assert (profile.slave, profile.function, profile.kind, profile.order) == (1, 3, "i32", "big")
    assert (profile.first, profile.count, profile.sign_bit, profile.flags) == (7, 2, None, ())
    (reading,) = ModbusParser(profile).feed(frame(1, 3, 4, words=(0xFFFF, 0xFFFE)))
    assert (reading.value, reading.stable, reading.flags) == (-2.0, None, LoadFlag.NONE)


FLAGS = {
    "overload": (LoadFlag.OVERLOAD, math.nan),
    "underload": (LoadFlag.UNDERLOAD, math.nan),
    "error": (LoadFlag.ERROR, math.nan),
    "unstable": (LoadFlag.UNSTABLE, 9.0),
    "net": (LoadFlag.NET, 9.0),
}


@pytest.mark.parametrize("name", FLAGS)
def test_each_flag_of_a_map(name: str) -> None:
    said = {"value": {"register": 4, "type": "u16"}, "flags": {name: {"register": 2, "mask": 8}}}
    flag, value = FLAGS[name]
    made = ModbusParser(profile_from(said, "test"))
    plain, raised = made.feed(frame(1, 3, 6, words=(7, 0, 9)) + frame(1, 3, 6, words=(8, 0, 9)))
    assert (plain.value, plain.flags) == (9.0, LoadFlag.NONE)
    assert (raised.value, raised.flags) == (pytest.approx(value, nan_ok=True), flag)
    assert [one.stable for one in (plain, raised)] == ([True, False] if name == "unstable" else [None] * 2)


@pytest.mark.parametrize(
    ("said", "words"),
    [
        ({"value": {"register": 1, "kind": "i32"}}, "unknown key value.kind"),
        ({"value": {"register": 1, "type": "i64"}}, "value.type"),
        ({"value": 3}, "a table is expected"),
        ({"slave": 0}, "slave = 0"),
        ({"slave": 248}, "slave = 248 is not possible; allowed: a whole number from 1 to 247"),
        ({"function": 5}, "function = 5 is not possible; allowed: a whole number from 3 to 4"),
        ({"value": {"register": 65535}}, "allowed: a whole number from 0 to 65534"),
        (
            {"value": {"register": 1, "order": "middle"}},
            "value.order = 'middle' is not possible; allowed: big",
        ),
        (
            {"sign": {"register": 0, "mask": 0}},
            "sign.mask = 0 is not possible; allowed: a whole number from 1",
        ),
        ({"sign": {"register": 0, "mask": 1, "set": 1}}, "sign.set must be true or false"),
        ({"flags": {"net": {"register": 31, "mask": 1}}, "value": {"register": 32}}, ""),
        ({"flags": {"net": {"register": 33, "mask": 1}}}, "registers span 33; one query reads at most 32"),
        ({"flags": {"peak": {"register": 0, "mask": 1}}}, "unknown key flags.peak"),
        ({"commands": {"stop": {"register": 1, "value": 1}}}, "commands.stop: there are tare and zero"),
        ({"commands": {"tare": {"register": 1, "value": 65536}}}, "commands.tare.value = 65536"),
        ({"commands": {"zero": {"register": 65536, "value": 1}}}, "commands.zero.register = 65536"),
        ({"slaves": 1}, "unknown key slaves; known: slave, function, value"),
    ],
)
def test_a_map_is_checked_key_by_key(said: dict[str, Any], words: str) -> None:
    table = {"value": {"register": 1}} | said
    if not words:
        assert profile_from(table, "test").count == 3
        return
    with pytest.raises(ConfigError) as caught:
        profile_from(table, "test")
    assert str(caught.value).startswith("profile test: ") and words in str(caught.value)


def test_a_map_may_reach_to_its_bounds() -> None:
    said = {"slave": 247, "function": 4, "value": {"register": 30}, "sign": {"register": 0, "mask": 65535}}
    made = ModbusParser(profile_from(said, "test"))
    assert made.commands["poll"] == frame(247, 4, words=(0, 32))
    words = (1, *[0] * 29, 1, 2)
    assert made.feed(frame(247, 4, 64, words=words))[0].value == -65538.0


def test_our_maps_are_those_of_their_makers() -> None:
    laumas, pt113 = load_profile("laumas-tlb"), load_profile("pt113")
    assert (laumas.register, laumas.kind, laumas.order, laumas.flags) == (7, "i32", "big", ())
    assert (pt113.register, pt113.kind, pt113.order) == (0, "i32", "big")
    error, unstable = pt113.flags
    assert (error.flag, error.register, error.mask, error.when_set) == (LoadFlag.ERROR, 2, 2, False)
    assert (unstable.flag, unstable.register, unstable.mask, unstable.when_set) == (
        LoadFlag.UNSTABLE, 2, 4, True,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("line", "flag"),
    [(b"+0000000,31,001", LoadFlag.OVERLOAD), (b"-0000001,31,001", LoadFlag.UNDERLOAD)],
)
def test_an_overflow_of_hbm_has_the_side_of_its_counts(line: bytes, flag: LoadFlag) -> None:
    reading = read_line("hbm-aed", line, "nominal=200")
    assert reading is not None and math.isnan(reading.value) and reading.flags is flag
