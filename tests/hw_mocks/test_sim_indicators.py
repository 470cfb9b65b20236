"""The simulated indicators: what they say, and what they answer, as conversations."""

from __future__ import annotations

import math
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hw_mocks.indicator import NEWTONS, Indicator, IndicatorReading, decimals
from hw_mocks.indicator_server import DAT400, PT113, ModbusIndicator, RegisterMap, crc
from hw_mocks.sim_indicators import (
    INDICATORS,
    AedStandardIndicator,
    HbmAedIndicator,
    Mark10Indicator,
    MtSicsIndicator,
    SauterIndicator,
)

shown = IndicatorReading
AT_12, OVER, UNDER = shown(12.34), shown(0, status="overload"), shown(0, status="underload")
G, LBF = 9.80665e-3, 4.4482216153
SICS, AED, HBM = MtSicsIndicator, AedStandardIndicator, HbmAedIndicator
LINES: dict[str, tuple[Indicator, IndicatorReading, bytes]] = {
    "sics stable": (SICS(0.01 * G, "g"), shown(100 * G), b"S S     100.00 g\r\n"),
    "sics dynamic": (SICS(0.01 * G, "g"), shown(100.03 * G, stable=False), b"S D     100.03 g\r\n"),
    "sics overload": (SICS(), OVER, b"S +\r\n"),
    "sics underload": (SICS(), UNDER, b"S -\r\n"),
    "sics error": (SICS(), shown(0, status="error"), b"S I\r\n"),
    "aed one header": (AED(0.01 * G, "g", second_header=False), shown(123.45 * G), b"ST,+00123.45  g\r\n"),
    "aed two headers": (AED(G, "kg"), shown(1234 * G), b"ST,GS,+0001.234kg\r\n"),
    "aed unstable": (AED(), shown(-18.3, stable=False), b"US,GS,-000018.3 N\r\n"),
    "aed overload": (AED(unit="g", second_header=False), OVER, b"OL,+9999999.9  g\r\n"),
    "aed blank": (AED(blank_overload=True), OVER, b"OL,GS,      .  N\r\n"),
    "aed prefix": (AED(prefix="01"), shown(5), b"01ST,GS,+000005.0 N\r\n"),
    "mark10 tension is negative": (Mark10Indicator(0.001), shown(-4.285), b"4.285 N\r\n"),
    "mark10 pounds": (Mark10Indicator(0.01 * LBF, "lbF"), shown(18.78 * LBF), b"-18.78 lbF\r\n"),
    "sauter tension": (SauterIndicator(0.01), shown(21.15), b"1021.15"),
    "sauter compression": (SauterIndicator(0.01), shown(-11.70), b"0011.70"),
    "sauter large": (SauterIndicator(0.01), shown(7712.32), b"17712.3"),
    "hbm": (HBM(nominal_N=10_000), shown(1234.5), b" 0123450,31,008\r\n"),
    "hbm negative": (HBM(nominal_N=10_000), shown(-1234.5, stable=False), b"-0123450,31,000\r\n"),
    "hbm overload": (HBM(), OVER, b" 1600000,31,011\r\n"),
    "hbm underload": (HBM(), shown(-1e9, status="underload"), b"-1600000,31,011\r\n"),
    "hbm counts a million at its nominal load": (HBM(), shown(10_000.0), b" 1000000,31,008\r\n"),
    "hbm has no zero below zero": (HBM(), shown(-0.04), b" 0000000,31,008\r\n"),
    "hbm of another nominal load": (HBM(nominal_N=500.0), shown(250.0), b" 0500000,31,008\r\n"),
}


@pytest.mark.parametrize(("indicator", "reading", "line"), LINES.values(), ids=LINES.keys())
def test_lines(indicator: Indicator, reading: IndicatorReading, line: bytes) -> None:
    assert indicator.render(reading) == line


def talk(indicator: Indicator, *conversation: tuple[bytes, bytes], reading: IndicatorReading = AT_12) -> None:
    for said, answered in conversation:
        assert indicator.receive(said, reading) == answered, said


def test_mt_sics_conversation() -> None:
    indicator = MtSicsIndicator()
    talk(
        indicator,
        (b"SI\r\n", b"S S       12.3 N\r\n"),
        (b"S\r\n", b"S S       12.3 N\r\n"),
        (b"I4\r\n", b'I4 A "B021002593"\r\n'),
        (b"si\r\n", b"ES\r\n"),
        (b"TI\r\n", b"TI S       12.3 N\r\n"),
        (b"SI\r\n", b"S S        0.0 N\r\n"),
        (b"TAC\r\n", b"TAC A\r\n"),
        (b"Z\r\n", b"Z A\r\n"),
    )
    talk(indicator, (b"S\r\n", b"S I\r\n"), (b"T\r\n", b"T I\r\n"), reading=shown(1, stable=False))
    talk(indicator, (b"SIR\r\n", b""))
    assert indicator.left == math.inf
    talk(indicator, (b"SI\r\n", b"S S        0.0 N\r\n"))
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
        (b"Q\r\n", b"ST,GS,+000012.3 N\r\n"),
        (b"T\r\n", b""),
        (b"Q\r\n", b"ST,NT,+000000.0 N\r\n"),
        (b"SIR\r\n", b""),
    )
    assert indicator.left == math.inf
    talk(indicator, (b"C\r\n", b""))
    assert indicator.left == 0


def test_mark10_conversation() -> None:
    indicator = Mark10Indicator()
    talk(
        indicator,
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
    )
    talk(indicator, (b"AOUT1\r", b""))
    assert (indicator.left, indicator.rate) == (math.inf, 50.0)
    talk(indicator, (b"AOUT250\r", b""))
    assert (indicator.left, indicator.rate) == (math.inf, 250.0)
    talk(indicator, (b"AOUT125\rAOUT0\r", b""))
    assert (indicator.left, indicator.rate) == (0, None)


def test_sauter_conversation() -> None:
    talk(SauterIndicator(0.01), (b"9", b"1012.34"), (b"x", b""), (b"99", b"1012.34" * 2))


def test_hbm_conversation() -> None:
    indicator = HbmAedIndicator()
    talk(
        indicator,
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
    )
    assert (indicator.left, indicator.rate) == (20, 25.0)
    talk(indicator, (b"MSV?0;", b""))
    assert indicator.left == math.inf
    talk(indicator, (b"STP;", b""))
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
    ("registers", "force", "words"),
    [
        (RegisterMap(value_type="f32"), 12.34, struct.pack(">f", 123)),
        (RegisterMap(value_type="u32"), 12.34, struct.pack(">I", 123)),
        (RegisterMap(value_type="u32"), -12.3, bytes(4)),  # without a sign nothing is below zero
        (RegisterMap(low_word_first=True), 12.34, struct.pack(">HH", 123, 0)),
    ],
)
def test_modbus_types_and_word_order(registers: RegisterMap, force: float, words: bytes) -> None:
    answer = ModbusIndicator(registers=registers).receive(read(7, 2), IndicatorReading(force))
    assert answer[3:7] == words


@pytest.mark.parametrize(
    ("registers", "shown", "tared", "status"),
    [
        (DAT400, AT_12, False, 0b10),
        (DAT400, IndicatorReading(0, stable=False, status="overload"), False, 0b100000),
        (DAT400, IndicatorReading(0.0, status="underload"), True, 0b11010),
        (PT113, AT_12, False, 0b010),
        (PT113, IndicatorReading(0, stable=False), False, 0b110),
    ],
)
def test_modbus_status_by_map(
    registers: RegisterMap, shown: IndicatorReading, tared: bool, status: int
) -> None:
    indicator, tare = ModbusIndicator(registers=registers), framed(struct.pack(">BBHH", 1, 6, 5, 2))
    assert not tared or indicator.receive(tare, AT_12) == tare
    assert int.from_bytes(indicator.receive(read(registers.status, 1), shown)[3:5]) == status


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


def test_mark10_keeps_the_highest_and_the_lowest() -> None:
    """Peak tension and peak compression since it was switched on, tension negative as all it shows."""
    indicator = Mark10Indicator()
    for force in (5.0, -7.0, 3.0):
        indicator.render(IndicatorReading(force))
    talk(indicator, (b"?PT\r", b"-5.0 N\r\n"), (b"?PC\r", b"7.0 N\r\n"))
    indicator.restart()
    talk(indicator, (b"?PT\r?PC\r", b"0.0 N\r\n0.0 N\r\n"), (b"KG\r?\r", b"-1.25 kgF\r\n"))


def test_mark10_tells_its_settings() -> None:
    indicator = Mark10Indicator()
    talk(indicator, (b"LIST\r", b"V1.00;N;CUR;FLTC8;FLTP1;AOUT0;FULL\r\n"), (b"AOUT25\r", b""))
    talk(indicator, (b"LIST\r", b"V1.00;N;CUR;FLTC8;FLTP1;AOUT25;FULL\r\n"), (b"FLTC3\r", b"*12\r\n"))


@pytest.mark.parametrize(
    ("number", "rate"), [(0, 100), (1, 50), (2, 25), (3, 12), (4, 6), (5, 3), (6, 2), (7, 1)]
)
def test_hbm_rates_have_their_numbers(number: int, rate: float) -> None:
    indicator = HbmAedIndicator()
    talk(indicator, (b"ICR%d;" % number, b"0\r\n"), (b"ICR8;", b"?\r\n"))
    assert indicator.rate == rate


@pytest.mark.parametrize(
    ("name", "line"),
    [
        ("ascii", (115200, 8, "N")),
        ("mt-sics", (9600, 8, "N")),
        ("aed-standard", (2400, 7, "E")),
        ("mark10", (9600, 8, "N")),
        ("sauter", (9600, 8, "N")),
        ("hbm-aed", (9600, 8, "E")),
        ("modbus", (9600, 8, "N")),
    ],
)
def test_each_has_the_line_it_is_delivered_with(name: str, line: tuple[int, int, str]) -> None:
    indicator = INDICATORS[name]()
    assert indicator.line == line
    assert (indicator.left, indicator.resolution) == (math.inf if indicator.unasked else 0, 0.1)
    assert indicator.unasked == (name in ("ascii", "aed-standard"))


def test_units_of_a_display_in_newtons() -> None:
    assert (
        pytest.approx(
            {"N": 1, "kN": 1000, "lbF": 4.4482216153, "kgF": 9.80665, "kg": 9.80665, "g": 0.00980665}
        )
        == NEWTONS
    )
    shown = IndicatorReading(1234.5, foreign_unit=True)
    assert MtSicsIndicator().render(shown) == b"S S     1.2345 kN\r\n"


def test_a_display_rounds_to_its_step_after_the_tare() -> None:
    indicator = MtSicsIndicator(0.5)
    indicator.tare(IndicatorReading(0.2))
    assert indicator.net(IndicatorReading(1.2)) == 1.0 and indicator.net(IndicatorReading(1.5)) == 1.5


def test_a_second_tare_is_under_the_whole_force() -> None:
    indicator = MtSicsIndicator()
    for force in (5.0, 8.0):
        indicator.tare(IndicatorReading(force))
    assert indicator.net(IndicatorReading(8.0)) == 0.0 and indicator.net(IndicatorReading(10.0)) == 2.0
    indicator.restart()
    assert indicator.net(IndicatorReading(8.0)) == 8.0
