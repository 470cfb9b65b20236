"""Finding out what talks: listening sends nothing, asking sends only what it said it would."""

from __future__ import annotations

import math

import pytest

from acquire.addresses import Options, parse_address
from acquire.errors import DeviceError
from acquire.protocols import find_protocol
from acquire.serial_line.identify import Question, ask, guess, hear, listen, questions
from acquire.serial_line.ports import LineSettings
from tests.acquire.serial_line.fake_port import FakePort, FakeTime


def even(text: bytes) -> bytes:
    """Seven-bit characters with even parity, as eight bits."""
    return bytes(byte | 0x80 if byte.bit_count() % 2 else byte for byte in text)


TALK = {
    "mt-sics": (
        b"S S     100.00 g\r\n",
        "protocol=mt-sics&baud=9600&bytesize=8&parity=N",
        "mass_reads_force",
    ),
    "aed-standard": (b"ST,GS,+0001.234kg\r\n", "protocol=aed-standard&baud=9600", "mass_reads_force"),
    "a number": (b"12.5\r\n", "protocol=ascii&baud=9600", "unit=N"),
    "a number with unit": (b"12.5 N\r\n", "protocol=ascii&baud=9600&bytesize=8&parity=N", ""),
    "time and number": (b"%d,0.5\r\n", "protocol=ascii&baud=9600&bytesize=8&parity=N&millis=1", "unit=N"),
    "openscale": (b"12345,0.512,kg,8388,21.5,\r\n", "protocol=ascii&baud=9600", "mass_reads_force"),
}


@pytest.mark.parametrize("name", TALK)
def test_what_is_heard_is_recognised(name: str) -> None:
    line, address, remark = TALK[name]
    heard = b"".join(line % (12345 + 100 * k) if b"%d" in line else line for k in range(12))
    found = guess("/dev/ttyUSB0", 9600, heard)
    assert found is not None
    assert found.address.startswith(f"/dev/ttyUSB0?{address}")
    assert remark in found.remark


def test_seven_bits_with_parity_are_recognised() -> None:
    found = guess("/dev/ttyUSB0", 2400, even(b"ST,GS,+0001.234kg\r\n" * 12))
    assert found is not None
    assert found.address == "/dev/ttyUSB0?protocol=aed-standard&baud=2400&bytesize=7&parity=E"


@pytest.mark.parametrize("heard", [b"", b"12.5 N\r\n", b"\x80\xfe\x00\x13" * 100, b"hello\r\n" * 30])
def test_silence_too_little_and_nonsense_are_nothing(heard: bytes) -> None:
    assert guess("/dev/ttyUSB0", 9600, heard) is None


def lines(values: list[float], notation: str, form: str) -> bytes:
    """Values as a device writes them: the decimal mark and what stands between thousands in ``notation``."""
    marks = str.maketrans({".": notation[0], ",": notation[1:]})
    texts = (f"{value:,.1f}".translate(marks) for value in values)
    return "".join(form.format(text, 5000 + 12 * k) + "\r\n" for k, text in enumerate(texts)).encode()


@pytest.mark.parametrize("form", ["{0} N", "{0}", "{1},{0}", "{1};{0}", "{1},{0} N", "F: {0} kN", "{0};21"])
@pytest.mark.parametrize("notation", [".,", ".", ",.", ",", ", ", ". "])
@pytest.mark.parametrize("step", [0.1, 7.3, 900.7])
def test_what_is_proposed_reads_rightly(form: str, notation: str, step: float) -> None:
    values = [900.5 + step * (k % 40) + step * k / 9 for k in range(120)]
    found = guess("/dev/ttyUSB0", 9600, lines(values, notation, form))
    if found is None:
        return
    options = Options(parse_address(found.address))
    for key in ("protocol", "baud", "bytesize", "parity"):
        options.text(key)
    parser = find_protocol(found.protocol).make_parser(options)
    parser.feed(b"\r\n")
    read = [r.value for r in parser.feed(lines(values, notation, form)) + parser.silence()]
    true = [float(f"{value:.1f}") for value in values]
    assert all(math.isnan(a) or a == pytest.approx(b) for a, b in zip(read, true, strict=True)), found.address


@pytest.mark.parametrize(
    ("form", "notation"), [("{0} N", "."), ("{0} N", ",."), ("{1},{0}", "."), ("{1};{0}", ",")]
)
def test_common_notations_are_proposed(form: str, notation: str) -> None:
    found = guess("/dev/ttyUSB0", 9600, lines([900.5 + 7 * k for k in range(120)], notation, form))
    assert found is not None and ("decimal=comma" in found.address) == (notation[0] == ",")
    assert "compare the display" in found.remark


class Ports:
    """A device that talks at one speed and answers some questions."""

    def __init__(self, talks_at: int = 0, answers: dict[bytes, bytes] | None = None) -> None:
        self.time, self.talks_at, self.answers = FakeTime(), talks_at, answers or {}
        self.opened: list[FakePort] = []

    def __call__(self, line: LineSettings) -> FakePort:
        talk = [b"12.5 N\r\n"] * 20 if line.baud == self.talks_at else [b"\x80\xff"] * 5
        self.opened.append(FakePort(self.time, list(talk) if self.talks_at else [], answers=self.answers))
        return self.opened[-1]


def test_listening_tries_the_speeds_and_sends_nothing() -> None:
    ports = Ports(talks_at=57600)
    tried = list(listen("/dev/ttyUSB0", opener=ports, clock=ports.time))
    assert [baud for baud, _, _ in tried] == [9600, 115200, 57600]
    assert tried[-1][2] is not None and tried[-1][2].protocol == "ascii"
    assert all(port.sent == [] and port.closed == 1 for port in ports.opened)


def test_asking_sends_just_that_question() -> None:
    ports = Ports(answers={b"9": b"1021.15"})
    (sauter,) = [q for q in questions("/dev/ttyUSB0") if q.protocol == "sauter"]
    found = ask(sauter, opener=ports, clock=ports.time)
    assert found is not None and found.address == "/dev/ttyUSB0?protocol=sauter&baud=9600"
    assert ports.opened[0].sent == [b"9"]


@pytest.mark.parametrize("question", questions("/dev/ttyUSB0"), ids=lambda q: q.protocol)
def test_no_answer_is_no_finding(question: Question) -> None:
    ports = Ports()
    assert ask(question, opener=ports, clock=ports.time) is None


def test_no_question_sets_or_moves_anything() -> None:
    harmless = {b"SI\r\n", b"Q\r\n", b"?C\r", b"9", b"MSV?;"}
    sent = {q.data for q in questions("/dev/ttyUSB0") if q.protocol != "modbus"}
    (modbus,) = [q.data for q in questions("/dev/ttyUSB0") if q.protocol == "modbus"]
    assert sent == harmless and modbus[1] == 3  # read registers


def test_a_port_lost_while_listening() -> None:
    time = FakeTime()
    with pytest.raises(DeviceError, match="lost while listening"):
        hear(LineSettings("/dev/x"), opener=lambda line: FakePort(time, [OSError(5, "gone")]), clock=time)
