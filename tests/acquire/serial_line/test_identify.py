"""What a port is taken for, by value: clocks, parities, words for a person, and what is asked."""

from __future__ import annotations

import pytest

from acquire.errors import DeviceError
from acquire.protocols.modbus import frame
from acquire.serial_line.identify import (
    SPEEDS,
    Finding,
    Question,
    ask,
    guess,
    listen,
    questions,
    record_bytes,
)
from acquire.serial_line.ports import LineSettings
from tests.acquire.serial_line.fake_port import FakePort, FakeTime
from tests.acquire.serial_line.test_ports import Ports, even


def found(heard: bytes, seconds: float = 1.5) -> Finding:
    finding = guess("/dev/ttyUSB0", 9600, heard, seconds)
    assert finding is not None
    return finding


@pytest.mark.parametrize(
    ("step_ms", "seconds", "taken"),
    [
        (100, 1.5, True),
        (30, 1.5, True),
        (25, 1.5, False),
        (270, 1.5, True),
        (280, 1.5, False),
        (280, 3.0, True),
    ],
)
def test_milliseconds_run_as_long_as_was_listened(step_ms: int, seconds: float, taken: bool) -> None:
    """Eleven steps: more than a fifth of the time and less than twice."""
    heard = b"".join(b"%d,0.5\r\n" % (12345 + step_ms * k) for k in range(13))
    finding = guess("/dev/ttyUSB0", 9600, heard, seconds)
    assert (finding is not None and "millis=1" in finding.address) == taken


@pytest.mark.parametrize(("steps", "taken"), [([100, 0, 100, 100], True), ([100, -1, 100, 100], False)])
def test_milliseconds_never_go_back(steps: list[int], taken: bool) -> None:
    ms, heard = 12345, b""
    for step in steps * 3:
        ms += step
        heard += b"%d,0.5\r\n" % ms
    finding = guess("/dev/ttyUSB0", 9600, heard)
    assert (finding is not None and "millis=1" in finding.address) == taken


def odd(text: bytes) -> bytes:
    """Seven-bit characters with odd parity, as eight bits."""
    return bytes(byte if byte.bit_count() % 2 else byte | 0x80 for byte in text)


@pytest.mark.parametrize(
    ("coded", "line"), [(even, "7&parity=E"), (odd, "7&parity=O"), (bytes, "8&parity=N")]
)
def test_seven_bits_have_the_parity_that_they_were_sent_with(coded: object, line: str) -> None:
    heard = coded(b"S S     100.00 N\r\n" * 12)  # type: ignore[operator]
    assert found(heard).address == f"/dev/ttyUSB0?protocol=mt-sics&baud=9600&bytesize={line}"


def test_what_is_found_is_shown_with_the_last_lines_and_how_they_are_read() -> None:
    finding = found(b"".join(b"%d.5 N\r\n" % k for k in range(12)))
    assert (finding.protocol, finding.score) == ("ascii", 1.0)
    assert finding.lines == (b"9.5 N", b"10.5 N", b"11.5 N")
    assert finding.remark == "'11.5 N' is read as 11.5: compare the display"


@pytest.mark.parametrize(
    ("line", "remark"),
    [
        (b"12.5\r\n", "the line names no unit: add unit=N, or the one on the display"),
        (b"12.5 kg\r\n", "the line says kg: add mass_reads_force=yes if that stands for a force"),
    ],
)
def test_what_an_address_still_lacks(line: bytes, remark: str) -> None:
    assert found(line * 12).remark.partition("; ")[2] == remark


def test_counts_of_hbm_are_proposed_without_a_scale() -> None:
    finding = found(b"+0012345,31,008\r\n" * 12)
    assert finding.address == "/dev/ttyUSB0?protocol=hbm-aed&baud=9600&bytesize=8&parity=N"
    assert finding.remark.startswith("'+0012345,31,008' is read as 12345: compare")


def test_speeds_are_tried_the_usual_ones_first() -> None:
    ports = Ports()
    assert [baud for baud, _, _ in listen("/dev/ttyUSB0", opener=ports, clock=ports.time)] == [*SPEEDS]
    assert SPEEDS == (9600, 115200, 57600, 19200, 2400, 4800, 38400, 1200)
    assert ports.time.now == pytest.approx(100 + 8 * 1.5, abs=1.0), "each for a second and a half"


def test_listening_ends_with_the_time_or_with_64_kB() -> None:
    time = FakeTime()

    def opened(line: LineSettings) -> FakePort:
        return FakePort(time, [bytes(4096)] * 100, pace=0.001)

    assert len(record_bytes(LineSettings("/dev/x"), opener=opened, clock=time)) == 65536
    assert len(record_bytes(LineSettings("/dev/x"), 0.0095, opener=opened, clock=time)) == 10 * 4096


QUESTIONS = {
    "mt-sics": (9600, 8, "N", b"SI\r\n"),
    "aed-standard": (2400, 7, "E", b"Q\r\n"),
    "mark10": (9600, 8, "N", b"?C\r"),
    "sauter": (9600, 8, "N", b"9"),
    "hbm-aed": (9600, 8, "E", b"MSV?;"),
    "modbus": (9600, 8, "N", frame(1, 3, words=(7, 2))),
}


def test_questions_are_asked_on_the_line_of_the_device() -> None:
    asked = {q.protocol: (q.line.baud, q.line.bytesize, q.line.parity, q.data) for q in questions("/dev/x")}
    assert asked == QUESTIONS
    assert {q.line.url for q in questions("/dev/x")} == {"/dev/x"}


ANSWERS = {
    "mt-sics": (b"S S     100.00 N\r\n", "protocol=mt-sics&baud=9600"),
    "aed-standard": (b"ST,GS,+0001.234 N\r\n", "protocol=aed-standard&baud=2400"),
    "mark10": (b"-18.78 lbF\r\n", "protocol=mark10&baud=9600"),
    "sauter": (b"1021.15", "protocol=sauter&baud=9600"),
    "hbm-aed": (b" 0012345,31,008\r\n", "protocol=hbm-aed&baud=9600&decimals=0"),
    "modbus": (frame(1, 3, 4, words=(0, 5)), "protocol=modbus&baud=9600&profile=laumas-tlb"),
}


def question(name: str) -> Question:
    return next(q for q in questions("/dev/x") if q.protocol == name)


@pytest.mark.parametrize("name", ANSWERS)
def test_an_answer_that_makes_sense_is_a_finding(name: str) -> None:
    answer, address = ANSWERS[name]
    ports = Ports(answers={question(name).data: answer})
    finding = ask(question(name), opener=ports, clock=ports.time)
    assert finding is not None
    assert (finding.address, finding.protocol, finding.score) == (f"/dev/x?{address}", name, 1.0)
    assert finding.lines == (answer.rstrip(b"\r\n"),)
    assert ports.opened[0].closed == 1


def test_what_it_sends_unasked_is_no_answer() -> None:
    time = FakeTime()
    port = FakePort(time, [b"1021.15"], pace=0.01)
    assert ask(question("sauter"), opener=lambda line: port, clock=time) is None
    assert port.sent == [b"9"] and time.now == pytest.approx(101.1, abs=0.15)


def test_a_port_that_is_lost_while_asking() -> None:
    time = FakeTime()
    port = FakePort(time, [OSError(5, "gone")])
    with pytest.raises(DeviceError, match=r"/dev/x: lost while asking \(gone\); check the cable"):
        ask(question("sauter"), opener=lambda line: port, clock=time)
    assert port.closed == 1
