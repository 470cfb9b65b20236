"""The parsers that a file configures: rules for lines, register maps for Modbus, and what is wrong with either."""

from __future__ import annotations

import math
import struct
from pathlib import Path

import pytest

from acquire.errors import ConfigError
from acquire.load_sample import LoadFlag
from acquire.protocols.base import find_protocol
from acquire.protocols.buffers import LineBuffer, number
from acquire.protocols.lines import PRESETS, load_preset, parser_from
from acquire.protocols.modbus import ModbusParser, frame, load_profile, profile_from
from tests.acquire.protocols.conversation import parser

OWN = r"""
pattern = 'W(?P<sign>[-+]) *(?P<value>[0-9,]+)(?P<unit>kN|N)(?P<flag>[?N]?)( t=(?P<ms>[0-9]+))?'
overload = "OL|--"
underload = "UL"
error = "Err"
unstable = "?"
net = "N"
decimal = "comma"
scale = 2
ends = "cr"
poll = 'W\r'
tare = 'T\r\n'
"""


@pytest.fixture
def own(tmp_path: Path) -> str:
    path = tmp_path / "mine.toml"
    path.write_text(OWN)
    return f"preset={path}"


def test_a_preset_of_ones_own(own: str) -> None:
    made = parser("lines", own)
    made.feed(b"\r")
    readings = made.feed(b"W- 12,5kN?\rW+3NN t=250\rOL\rW UL\rErr 5\rW+1,2,3N\r")
    values = [reading.value for reading in readings]
    assert values == pytest.approx([-25.0, 6.0, math.nan, math.nan, math.nan, math.nan], nan_ok=True)
    assert [reading.flags for reading in readings] == [
        LoadFlag.UNSTABLE,
        LoadFlag.NET,
        LoadFlag.OVERLOAD,
        LoadFlag.UNDERLOAD,
        LoadFlag.ERROR,
        LoadFlag.ERROR,
    ]
    assert [reading.stable for reading in readings[:2]] == [False, True]
    assert (readings[0].unit, readings[1].unit, readings[1].device_ms) == ("kN", "N", 250.0)


def test_commands_of_a_preset(own: str) -> None:
    assert parser("lines", own).commands == {"poll": b"W\r", "tare": b"T\r\n"}


@pytest.mark.parametrize("name", ["rinstrum", "sartorius", "ohaus", "loadstar", "dillon"])
def test_presets_of_ours_are_sound(name: str) -> None:
    parser_from(load_preset(name))


SETTINGS_OF_DEVICES = {
    "aed-standard": (1, 2400, 7, "E", "listen", True, True),
    "ascii": (1, 9600, 8, "N", "listen", False, True),
    "hbm-aed": (1, 9600, 8, "E", "stream", True, False),
    "mark10": (-1, 9600, 8, "N", "stream", False, True),
    "modbus": (1, 9600, 8, "N", "poll", False, False),
    "mt-sics": (1, 9600, 8, "N", "stream", True, True),
    "sauter": (1, 9600, 8, "N", "poll", False, False),
}
"""Sign of tension, line, who begins, whether an overload has a mark and the line a unit."""


@pytest.mark.parametrize("name", SETTINGS_OF_DEVICES)
def test_a_protocol_without_settings_is_that_of_its_device(name: str) -> None:
    p = find_protocol(name)
    found = (p.sign, p.baud, p.bytesize, p.parity, p.mode, p.flags_overload, p.unit_on_line)
    assert found == SETTINGS_OF_DEVICES[name]


def test_the_rates_of_streams_have_their_commands() -> None:
    assert dict(find_protocol("hbm-aed").rates) == {
        100.0: b"ICR0;MSV?0;", 50.0: b"ICR1;MSV?0;", 25.0: b"ICR2;MSV?0;", 12.0: b"ICR3;MSV?0;",
        6.0: b"ICR4;MSV?0;", 3.0: b"ICR5;MSV?0;", 2.0: b"ICR6;MSV?0;", 1.0: b"ICR7;MSV?0;",
    }  # fmt: skip
    assert find_protocol("mark10").rates == {float(n): b"AOUT%d\r" % n for n in (2, 5, 10, 25, 50, 125, 250)}


def test_bytes_never_fed_count_for_the_place_of_a_line() -> None:
    buffer = LineBuffer()
    assert [line.start for line in buffer.feed(b"..\nabc\nde")] == [3]
    buffer.restart(lost=100)
    assert [(line.data, line.start) for line in buffer.feed(b"f\nxyz\n")] == [(b"xyz", 7 + 2 + 100 + 2)]


@pytest.mark.parametrize(
    ("text", "value"), [("1.234,5", 1234.5), ("-1.234.567,5", -1234567.5), ("12.345.678,", 12345678.0)]
)
def test_points_between_thousands_of_a_decimal_comma(text: str, value: float) -> None:
    assert number(text, decimal_comma=True) == value


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("unit = 'N'", "needs pattern="),
        ("pattern = '(?P<value>'", "no regular expression"),
        ("pattern = '[0-9]+'", "names no value"),
        ("pattern = '(?P<value>.)'\nends = 'nul'", "ends=nul"),
        ("pattern = '(?P<value>.)'\nscale = 0", "scale=0"),
        ("patern = '(?P<value>.)'", "unknown key 'patern'"),
        ("pattern = ", "mine.toml"),
    ],
)
def test_wrong_rules_are_refused_in_words(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(text)
    with pytest.raises(ConfigError, match=words):
        parser("lines", f"preset={path}")


def test_unknown_presets_list_the_known(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="rinstrum, sartorius"):
        load_preset("nobody")
    with pytest.raises(ConfigError, match="No such file"):
        load_preset(str(tmp_path / "nothing.toml"))
    assert PRESETS.exists()


def test_the_example_reads_the_lines_that_it_shows() -> None:
    path = Path(__file__).parents[3] / "examples" / "own-protocol" / "scale.toml"
    shown = [line[6:] for line in path.read_text().splitlines() if line.startswith("#     ")]
    made = parser("lines", f"preset={path}")
    readings = made.feed("".join(f"{line}\r\n" for line in ["", *shown]).encode())
    assert [reading.value for reading in readings] == pytest.approx([12.345, -0.12, math.nan], nan_ok=True)
    assert [reading.unit for reading in readings] == ["kN", "kN", None]
    assert [reading.flags for reading in readings] == [LoadFlag.NONE, LoadFlag.UNSTABLE, LoadFlag.OVERLOAD]
    assert made.commands["tare"] == b"T\r\n"


def answer(*words: int, slave: int = 1, function: int = 3) -> bytes:
    return frame(slave, function, 2 * len(words), words=words)


@pytest.mark.parametrize(
    ("status", "value", "stable", "flags"),
    [
        (0b010, -2.0, True, LoadFlag.NONE),
        (0b110, -2.0, False, LoadFlag.UNSTABLE),
        (0b000, math.nan, True, LoadFlag.ERROR),
    ],
)
def test_flags_and_their_polarity(status: int, value: float, stable: bool, flags: LoadFlag) -> None:
    made = parser("modbus", "profile=pt113&scale=0.01")
    (reading,) = made.feed(answer(0xFFFF, 0xFF38, status))
    assert reading.value == pytest.approx(value, nan_ok=True)
    assert (reading.stable, reading.flags) == (stable, flags)


KINDS = {"i16": ">h", "u16": ">H", "i32": ">i", "u32": ">I", "f32": ">f"}


@pytest.mark.parametrize("order", ["big", "little"])
@pytest.mark.parametrize("kind", KINDS)
def test_every_type_and_word_order(kind: str, order: str) -> None:
    value = 1234.5 if kind == "f32" else -1234 if kind.startswith("i") else 1234
    packed = struct.pack(KINDS[kind], value)
    words = struct.unpack(f">{len(packed) // 2}H", packed)
    profile = profile_from({"value": {"register": 4, "type": kind, "order": order}}, "test")
    (reading,) = ModbusParser(profile).feed(answer(*(words[::-1] if order == "little" else words)))
    assert reading.value == value


def test_sign_apart_from_magnitude() -> None:
    said = {"value": {"register": 7, "type": "u32"}, "sign": {"register": 6, "mask": 128}}
    made = ModbusParser(profile_from(said, "test"))
    assert made.feed(answer(128, 0, 55))[0].value == -55
    assert made.feed(answer(0, 0, 55))[0].value == 55


def test_commands_of_a_profile() -> None:
    said = {"value": {"register": 0}, "commands": {"tare": {"register": 5, "value": 7}}}
    made = ModbusParser(profile_from(said, "test"))
    assert made.commands["tare"][:-2] == bytes([1, 6, 0, 5, 0, 7])
    assert made.feed(made.commands["tare"] + answer(0, 9))[0].value == 9  # the echo is no reading


def test_exception_is_an_error_not_a_value() -> None:
    (reading,) = parser("modbus", "profile=pt113").feed(frame(1, 0x83, 2))
    assert math.isnan(reading.value) and reading.flags is LoadFlag.ERROR


def test_a_wrong_profile_names_its_file_or_key(tmp_path: Path) -> None:
    for text, words in (("slave = 1", "'value' is missing"), ("value = { register = ", "Invalid")):
        (tmp_path / "my.toml").write_text(text)
        with pytest.raises(ConfigError, match=words):
            load_profile(str(tmp_path / "my.toml"))


def test_profiles_of_ours_are_sound() -> None:
    assert load_profile("laumas-tlb").count == 2
    with pytest.raises(ConfigError, match="laumas-tlb, pt113"):
        load_profile("nobody")
    with pytest.raises(ConfigError, match="my-own"):
        load_profile("my-own.toml")
