"""Lines of sketches and of unknown devices: what is recognised, what is proposed, and that it reads rightly."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acquire.addresses import Options, parse_address
from acquire.errors import DeviceError
from acquire.protocols.base import Reading, find_protocol, is_mass, newtons_per
from acquire.serial_line import identify as search
from acquire.serial_line.identify import Finding, guess, listen, pattern_of, proposed
from acquire.serial_line.ports import LineSettings
from live.commands import identify
from tests.acquire.serial_line.fake_port import FakePort
from tests.acquire.serial_line.test_identify import Ports

LINE = LineSettings("/dev/ttyUSB0", 9600)
VALUES = [12.5, -0.25, 3.0, 100.75, 7.5, 8.25, 9.0, 12.25, 13.5, 14.75]


def heard(form: Callable[[int, float], str]) -> bytes:
    return ("begun\r\n" + "".join(form(k, value) + "\r\n" for k, value in enumerate(VALUES))).encode()


def read(finding: Finding, received: bytes) -> list[Reading]:
    """With the parser of the proposed address."""
    options = Options(parse_address(finding.address))
    for key in ("protocol", "baud", "bytesize", "parity"):
        options.text(key)
    return find_protocol(finding.protocol).make_parser(options).feed(received)


SKETCHES: dict[str, tuple[Callable[[int, float], str], str | None]] = {
    "HX711 example": (lambda k, v: f"one reading:\t{v:.2f}\t| average:\t{v + 1:.5f}", None),
    "one line, blanks": (lambda k, v: f"one reading: {v:.2f} | average: {v + 1:.1f}", None),
    "plotter": (lambda k, v: f"Force:{v:.2f},Raw:{8123000 + k}", None),
    "plotter, value last": (lambda k, v: f"Raw:{8123000 + k}\tWeight:{v:.2f}g", "g"),
    "JSON": (lambda k, v: f'{{"t":{100 * k},"force":{v:.2f},"unit":"N"}}', "N"),
    "JSON, time last": (lambda k, v: f'{{"weight": {v:.2f}, "t": {100 * k}}}', None),
    "label": (lambda k, v: f"Load_cell output val: {v:.2f}", None),
    "pounds": (lambda k, v: f"{v:.2f} lb.", "lb"),
    "newton": (lambda k, v: f"Kraft = {v:.2f} Newton", "Newton"),
    "percent and quote": (lambda k, v: f"Load'%&#: {v:.2f} kg | bat 97 %", "kg"),
}


@pytest.mark.parametrize("name", SKETCHES)
def test_common_lines_are_recognised_and_read(name: str) -> None:
    form, unit = SKETCHES[name]
    received = heard(form)
    finding = guess("/dev/ttyUSB0", 9600, received)
    assert finding is not None
    readings = read(finding, received)
    assert [reading.value for reading in readings] == VALUES
    assert {reading.unit for reading in readings} == {unit}
    assert ("names no unit" in finding.remark) is (unit is None)


def test_frames_of_rinstrum_are_recognised() -> None:
    finding = guess("/dev/ttyUSB0", 9600, b"".join(b"\x02+%07dG\x03" % (1234 + k) for k in range(12)))
    assert finding is not None and finding.address.endswith(
        "protocol=lines&baud=9600&bytesize=8&parity=N&preset=rinstrum"
    )


def test_large_whole_numbers_may_be_counts() -> None:
    finding = guess(
        "/dev/ttyUSB0", 9600, b"x\r\n" + b"".join(b"%d\r\n" % (8123400 + 7 * k % 5) for k in range(12))
    )
    assert finding is not None and finding.protocol == "ascii"
    assert "perhaps raw counts: phasedic load-calibrate" in finding.remark


UNKNOWN: dict[str, Callable[[int, float], str]] = {
    "two channels": lambda k, v: f"CH1 {v:.2f} CH2 {v + 1:.2f} OK",
    "table": lambda k, v: f"{100 * k},{v:.2f},{v + 1:.3f},ok",
}


@pytest.mark.parametrize("name", UNKNOWN)
def test_for_unknown_lines_a_pattern_is_proposed_and_nothing_guessed(name: str) -> None:
    received = heard(UNKNOWN[name])
    assert guess("/dev/ttyUSB0", 9600, received) is None
    finding = proposed(LINE, received)
    assert finding is not None
    assert [reading.value for reading in read(finding, received)] == VALUES


@pytest.mark.parametrize(
    "received",
    [b"", b"1 2 a\r\n" * 5, b"hello\r\n" * 30, b"\x80\xfe\x00\x13\r\n" * 100, b"a 1 b\r\nc 2 d 3\r\n" * 10],
)
def test_no_pattern_is_made_of_too_little_and_of_nonsense(received: bytes) -> None:
    assert pattern_of(received) is None and proposed(LINE, received) is None


def test_two_numbers_that_may_be_one_are_not_recognised() -> None:
    assert guess("/dev/ttyUSB0", 9600, heard(lambda k, v: f"Force: 1,{abs(v):06.2f} | 7")) is None


@settings(max_examples=100)
@given(st.binary(max_size=300))
def test_any_bytes_make_a_pattern_or_none(received: bytes) -> None:
    finding = proposed(LINE, received * 6)
    assert finding is None or all(not math.isinf(reading.value) for reading in read(finding, received * 6))


@pytest.mark.parametrize(
    "address",
    [
        "/dev/ttyUSB0?protocol=lines&pattern=F(?P<value>[0-9.]+) ?N&unit=N",
        "/dev/ttyUSB0?pattern=F(?P<value>[0-9.]+) ?N&protocol=lines&unit=N",
    ],
)
def test_a_pattern_in_an_address_may_have_question_marks(address: str) -> None:
    parsed = parse_address(address)
    assert parsed.target == "/dev/ttyUSB0"
    assert dict(parsed.settings) == {"protocol": "lines", "pattern": "F(?P<value>[0-9.]+) ?N", "unit": "N"}


def test_a_unit_may_end_in_a_point_or_be_spelled_out() -> None:
    assert is_mass("lb.") and newtons_per("Newton") == newtons_per("N")


def test_a_speed_that_the_port_refuses_is_left_out() -> None:
    ports = Ports(talks_at=57600)

    def opener(line: LineSettings) -> FakePort:
        if line.baud == 115200:
            raise DeviceError("/dev/ttyUSB0: cannot be opened")
        return ports(line)

    assert [baud for baud, _, _ in listen("/dev/ttyUSB0", opener=opener, clock=ports.time)] == [9600, 57600]


def test_a_port_that_opens_at_no_speed_is_refused() -> None:
    def opener(line: LineSettings) -> FakePort:
        raise DeviceError(f"{line.url}: is not there, at {line.baud}")

    with pytest.raises(DeviceError, match="is not there, at 9600"):
        list(listen("/dev/ttyUSB0", opener=opener))


def test_the_command_shows_lines_and_a_pattern(monkeypatch: pytest.MonkeyPatch) -> None:
    received = heard(UNKNOWN["two channels"])
    monkeypatch.setattr(search, "listen", lambda device: iter([(9600, b"", None), (57600, received, None)]))
    said: list[str] = []
    assert identify.command(argparse.Namespace(device="/dev/ttyUSB0", ask=False), said.append) == 6
    assert "lines that no protocol knows, at 57600 baud:" in said
    assert "  CH1 14.75 CH2 15.75 OK" in said
    assert any(line.startswith("use  --load '/dev/ttyUSB0?protocol=lines&baud=57600") for line in said)


def test_a_question_that_the_port_refuses_does_not_end_the_search(monkeypatch: pytest.MonkeyPatch) -> None:
    def ask(question: search.Question) -> None:
        if question.line.parity != "N":
            raise DeviceError("/dev/x: cannot be opened (parity)")

    monkeypatch.setattr(search, "listen", lambda device: iter([(9600, b"", None)]))
    monkeypatch.setattr(search, "ask", ask)
    said: list[str] = []
    assert identify.command(argparse.Namespace(device="/dev/x", ask=True), said.append) == 6
    assert "  aed-standard: /dev/x: cannot be opened (parity)" in said
    assert "  modbus: no answer" in said
