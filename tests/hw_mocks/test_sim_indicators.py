"""The simulated indicators: what they say, and what they answer, as conversations."""

from __future__ import annotations

import math
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hw_mocks.indicator import Indicator, IndicatorReading, decimals
from hw_mocks.modbus_indicator import DAT400, PT113, ModbusIndicator, RegisterMap, crc
from hw_mocks.sim_indicators import (
    INDICATORS,
    AedStandardIndicator,
    HbmAedIndicator,
    Mark10Indicator,
    MtSicsIndicator,
    SauterIndicator,
)

AT_12 = IndicatorReading(12.34)
G = 9.80665e-3
LINES: dict[str, tuple[Indicator, IndicatorReading, bytes]] = {
    "sics stable": (MtSicsIndicator(0.01 * G, "g"), IndicatorReading(100 * G), b"S S     100.00 g\r\n"),
    "sics dynamic": (
        MtSicsIndicator(0.01 * G, "g"),
        IndicatorReading(100.03 * G, stable=False),
        b"S D     100.03 g\r\n",
    ),
    "sics overload": (MtSicsIndicator(), IndicatorReading(0, status="overload"), b"S +\r\n"),
    "sics underload": (MtSicsIndicator(), IndicatorReading(0, status="underload"), b"S -\r\n"),
    "sics error": (MtSicsIndicator(), IndicatorReading(0, status="error"), b"S I\r\n"),
    "aed one header": (
        AedStandardIndicator(0.01 * G, "g", second_header=False),
        IndicatorReading(123.45 * G),
        b"ST,+00123.45  g\r\n",
    ),
    "aed two headers": (
        AedStandardIndicator(G, "kg"),
        IndicatorReading(1.234 * 9.80665),
        b"ST,GS,+0001.234kg\r\n",
    ),
    "aed unstable": (AedStandardIndicator(), IndicatorReading(-18.3, stable=False), b"US,GS,-000018.3 N\r\n"),
    "aed overload": (
        AedStandardIndicator(unit="g", second_header=False),
        IndicatorReading(0, status="overload"),
        b"OL,+9999999.9  g\r\n",
    ),
    "aed blank": (
        AedStandardIndicator(blank_overload=True),
        IndicatorReading(0, status="overload"),
        b"OL,GS,      .  N\r\n",
    ),
    "aed prefix": (AedStandardIndicator(prefix="01"), IndicatorReading(5), b"01ST,GS,+000005.0 N\r\n"),
    "mark10 tension is negative": (Mark10Indicator(0.001), IndicatorReading(-4.285), b"4.285 N\r\n"),
    "mark10 pounds": (
        Mark10Indicator(0.01 * 4.4482216153, "lbF"),
        IndicatorReading(18.78 * 4.4482216153),
        b"-18.78 lbF\r\n",
    ),
    "sauter tension": (SauterIndicator(0.01), IndicatorReading(21.15), b"1021.15"),
    "sauter compression": (SauterIndicator(0.01), IndicatorReading(-11.70), b"0011.70"),
    "sauter large": (SauterIndicator(0.01), IndicatorReading(7712.32), b"17712.3"),
    "hbm": (HbmAedIndicator(nominal_N=10_000), IndicatorReading(1234.5), b" 0123450,31,008\r\n"),
    "hbm negative": (
        HbmAedIndicator(nominal_N=10_000),
        IndicatorReading(-1234.5, stable=False),
        b"-0123450,31,000\r\n",
    ),
    "hbm overload": (HbmAedIndicator(), IndicatorReading(0, status="overload"), b" 1600000,31,011\r\n"),
}


@pytest.mark.parametrize(("indicator", "shown", "line"), LINES.values(), ids=LINES.keys())
def test_lines(indicator: Indicator, shown: IndicatorReading, line: bytes) -> None:
    assert indicator.render(shown) == line


def talk(
    indicator: Indicator, conversation: list[tuple[bytes, bytes]], shown: IndicatorReading = AT_12
) -> None:
    for said, answered in conversation:
        assert indicator.receive(said, shown) == answered, said


def test_mt_sics_conversation() -> None:
    indicator = MtSicsIndicator()
    talk(
        indicator,
        [
            (b"SI\r\n", b"S S       12.3 N\r\n"),
            (b"S\r\n", b"S S       12.3 N\r\n"),
            (b"I4\r\n", b'I4 A "B021002593"\r\n'),
            (b"si\r\n", b"ES\r\n"),
            (b"TI\r\n", b"TI S       12.3 N\r\n"),
            (b"SI\r\n", b"S S        0.0 N\r\n"),
            (b"TAC\r\n", b"TAC A\r\n"),
            (b"Z\r\n", b"Z A\r\n"),
        ],
    )
    talk(indicator, [(b"S\r\n", b"S I\r\n"), (b"T\r\n", b"T I\r\n")], IndicatorReading(1, stable=False))
    talk(indicator, [(b"SIR\r\n", b"")])
    assert indicator.left == math.inf
    talk(indicator, [(b"SI\r\n", b"S S        0.0 N\r\n")])
    assert indicator.left == 0


def test_commands_come_in_any_pieces() -> None:
    indicator = MtSicsIndicator()
    assert indicator.receive(b"S", AT_12) == b""
    assert indicator.receive(b"I\r", AT_12) == b"S S       12.3 N\r\n"
    assert indicator.receive(b"\nSI\r\nSI\r\n", AT_12) == b"S S       12.3 N\r\n" * 2


def test_aed_standard_conversation() -> None:
    indicator = AedStandardIndicator()
    talk(
        indicator,
        [
            (b"Q\r\n", b"ST,GS,+000012.3 N\r\n"),
            (b"T\r\n", b""),
            (b"Q\r\n", b"ST,NT,+000000.0 N\r\n"),
            (b"SIR\r\n", b""),
        ],
    )
    assert indicator.left == math.inf
    talk(indicator, [(b"C\r\n", b"")])
    assert indicator.left == 0


def test_mark10_conversation() -> None:
    indicator = Mark10Indicator()
    talk(
        indicator,
        [
            (b"?\r", b"-12.3 N\r\n"),
            (b"NUM\r\n?C\r\n", b"-12.3\r\n"),
            (b"FULL\r", b""),
            (b"?PT\r", b"-12.3 N\r\n"),
            (b"LB\r?\r", b"-2.77 lbF\r\n"),
            (b"N\rZ\r?\r", b"0.0 N\r\n"),
            (b"JUMP\r", b"*10\r\n"),
            (b"AOUTX\r", b"*12\r\n"),
            (b"AOUT7\r", b"*12\r\n"),
            (b"AOUT999\r", b"*22\r\n"),
            (b"FLTC8\r", b""),
        ],
    )
    talk(indicator, [(b"AOUT1\r", b"")])
    assert (indicator.left, indicator.rate) == (math.inf, 50.0)
    talk(indicator, [(b"AOUT125\rAOUT0\r", b"")])
    assert (indicator.left, indicator.rate) == (0, None)


def test_sauter_conversation() -> None:
    talk(SauterIndicator(0.01), [(b"9", b"1012.34"), (b"x", b""), (b"99", b"1012.34" * 2)])


def test_hbm_conversation() -> None:
    indicator = HbmAedIndicator()
    talk(
        indicator,
        [
            (b"MSV?;", b" 0001230,31,008\r\n"),
            (b"COF3;MSV?;", b"0\r\n 0001230\r\n"),
            (b"COF11;MSV?\n", b"0\r\n 0001230,008\r\n"),
            (b"COF77;", b"?\r\n"),
            (b"IDN?;", b"HBM,AD103C,0012345,P20\r\n"),
            (b"ESR?;", b"000\r\n"),
            (b"NOV?;", b"0000000\r\n"),
            (b"TAR;MSV?;", b"0\r\n 0000000,008\r\n"),
            (b"ICR2;", b"0\r\n"),
            (b"HELLO;", b"?\r\n"),
            (b"MSV?20;", b""),
        ],
    )
    assert (indicator.left, indicator.rate) == (20, 25.0)
    talk(indicator, [(b"MSV?0;", b"")])
    assert indicator.left == math.inf
    talk(indicator, [(b"STP;", b"")])
    assert indicator.left == 0


def framed(body: bytes) -> bytes:
    return body + crc(body)


def read(register: int, number: int, slave: int = 1) -> bytes:
    return framed(struct.pack(">BBHH", slave, 3, register, number))


def test_crc_is_that_of_the_standard() -> None:
    assert crc(bytes.fromhex("010300000001")) == bytes.fromhex("840a")
    assert crc(b"123456789") == bytes.fromhex("374b")


def test_modbus_reads_the_laumas_registers() -> None:
    indicator = ModbusIndicator()
    answer = indicator.receive(read(7, 2), IndicatorReading(-12.3))
    assert answer == framed(b"\x01\x03\x04" + struct.pack(">i", -123))
    assert indicator.receive(read(7, 2, slave=2), AT_12) == b""


@pytest.mark.parametrize(
    ("registers", "words"),
    [
        (RegisterMap(value_type="f32"), struct.pack(">f", 123)),
        (RegisterMap(value_type="u32"), struct.pack(">I", 123)),
        (RegisterMap(low_word_first=True), struct.pack(">HH", 123, 0)),
    ],
)
def test_modbus_types_and_word_order(registers: RegisterMap, words: bytes) -> None:
    answer = ModbusIndicator(registers=registers).receive(read(7, 2), AT_12)
    assert answer[3:7] == words


def test_modbus_status_by_map() -> None:
    def status(registers: RegisterMap, shown: IndicatorReading) -> int:
        answer = ModbusIndicator(registers=registers).receive(read(registers.status, 1), shown)
        return int.from_bytes(answer[3:5])

    assert status(DAT400, AT_12) == 0b10
    assert status(DAT400, IndicatorReading(0, stable=False, status="overload")) == 0b100000
    assert status(PT113, AT_12) == 0b010
    assert status(PT113, IndicatorReading(0, stable=False)) == 0b110


def test_modbus_holds_its_peak_until_it_is_reset() -> None:
    registers = DAT400
    indicator = ModbusIndicator(registers=registers)
    shown = []
    for force in (12.0, 55.5, 3.0):
        answer = indicator.receive(read(registers.peak, 2), IndicatorReading(force))
        shown.append(int.from_bytes(answer[3:7], signed=True))
    assert shown == [120, 555, 555]
    reset = framed(struct.pack(">BBHH", 1, 6, registers.command, registers.reset_peak))
    assert indicator.receive(reset, IndicatorReading(3.0)) == reset
    assert indicator.receive(read(registers.peak, 2), IndicatorReading(2.0))[3:7] == struct.pack(">i", 30)


def test_modbus_tare_by_command_register() -> None:
    indicator = ModbusIndicator()
    request = framed(struct.pack(">BBHH", 1, 6, 5, 7))
    assert indicator.receive(request, AT_12) == request
    assert indicator.receive(read(9, 2), AT_12)[3:7] == bytes(4)
    assert indicator.receive(read(7, 2), AT_12)[3:7] == struct.pack(">i", 123)
    many = framed(struct.pack(">BBHHBH", 1, 16, 5, 1, 2, 8))
    assert indicator.receive(many, AT_12) == framed(many[:6])


@pytest.mark.parametrize(
    ("request_body", "code"),
    [
        (struct.pack(">BBHH", 1, 3, 30, 4), 2),
        (struct.pack(">BBHH", 1, 3, 0, 33), 3),
        (struct.pack(">BBHH", 1, 6, 5, 99), 3),
        (struct.pack(">BBHH", 1, 6, 99, 1), 2),
        (struct.pack(">BBHH", 1, 4, 0, 1), 1),
    ],
)
def test_modbus_exceptions(request_body: bytes, code: int) -> None:
    answer = ModbusIndicator().receive(framed(request_body), AT_12)
    assert answer == framed(bytes([1, request_body[1] | 0x80, code]))


def test_modbus_finds_back_into_step() -> None:
    indicator = ModbusIndicator()
    assert indicator.receive(b"\x07\x00" + read(7, 2)[:3], AT_12) == b""
    assert len(indicator.receive(read(7, 2)[3:] + read(7, 2), AT_12)) == 18


@pytest.mark.parametrize("name", INDICATORS)
@given(pieces=st.lists(st.binary(max_size=40), max_size=8))
def test_any_bytes_are_survived(name: str, pieces: list[bytes]) -> None:
    indicator = INDICATORS[name]()
    for piece in pieces:
        assert isinstance(indicator.receive(piece, AT_12), bytes)
    assert indicator.render(AT_12)


@pytest.mark.parametrize(("step", "digits"), [(1, 0), (0.1, 1), (0.02, 2), (5, 0), (0.0224, 2), (1e-4, 4)])
def test_decimals(step: float, digits: int) -> None:
    assert decimals(step) == digits
