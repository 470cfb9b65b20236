"""What a port is taken for, by value: protocols, clocks, parities, words for a person, and what is asked."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest

from acquire.addresses import Options, parse_address
from acquire.errors import DeviceError
from acquire.protocols.base import find_protocol
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


class Ports:
    """A device that talks at one speed and answers some questions."""

    def __init__(self, talks_at: int = 0, answers: dict[bytes, bytes] | None = None) -> None:
        self.time, self.talks_at, self.answers = FakeTime(), talks_at, answers or {}
        self.opened: list[FakePort] = []

    def __call__(self, line: LineSettings) -> FakePort:
        talk = [b"12.5 N\r\n"] * 20 if line.baud == self.talks_at else [b"\x80\xff"] * 5
        self.opened.append(FakePort(self.time, list(talk) if self.talks_at else [], answers=self.answers))
        return self.opened[-1]


def found(heard: bytes, seconds: float = 1.5) -> Finding:
    finding = guess("/dev/ttyUSB0", 9600, heard, seconds)
    assert finding is not None
    return finding


MASS = "the line says {}: add mass_reads_force=yes if that stands for a force"
UNITLESS = "the line names no unit: add unit=N, or the one on the display"


@pytest.mark.parametrize(
    ("line", "protocol", "remark"),
    [
        (b"S S     100.00 g", "mt-sics", MASS.format("g")),
        (b"ST,GS,+0001.234kg", "aed-standard", MASS.format("kg")),
        (b"12.5", "ascii", UNITLESS),
        (b"12.5 N", "ascii", ""),
        (b"12.5 kg", "ascii", MASS.format("kg")),
        (b"%d,0.5", "ascii", UNITLESS),
        (b"12345,0.512,kg,8388,21.5,", "ascii", MASS.format("kg")),
    ],
)
def test_what_is_heard_is_recognised_with_what_its_address_lacks(
    line: bytes, protocol: str, remark: str
) -> None:
    finding = found(b"".join(line.replace(b"%d", b"%d" % (12345 + 100 * k)) + b"\r\n" for k in range(12)))
    assert finding.address.startswith(f"/dev/ttyUSB0?protocol={protocol}&baud=9600&bytesize=8&parity=N")
    assert ("millis=1" in finding.address) == (b"%d" in line)
    assert finding.remark.partition("; ")[2] == remark


@pytest.mark.parametrize("heard", [b"", b"12.5 N\r\n", b"\x80\xfe\x00\x13" * 100, b"hello\r\n" * 30])
def test_silence_too_little_and_nonsense_are_nothing(heard: bytes) -> None:
    assert guess("/dev/ttyUSB0", 9600, heard) is None


@pytest.mark.parametrize(("whole", "known"), [(5, True), (4, False)])
def test_five_lines_make_a_protocol(whole: int, known: bool) -> None:
    """The first of them may have lost its beginning, and does not count."""
    assert (guess("/dev/ttyUSB0", 9600, b"12.5 N\r\n" * (whole + 1)) is not None) is known


@pytest.mark.parametrize(("good", "known"), [(8, True), (7, False)])
def test_four_of_five_lines_must_be_readings(good: int, known: bool) -> None:
    heard = b"12.5 N\r\n" * (good + 1) + b"no reading here\r\n" * (10 - good)
    found = guess("/dev/ttyUSB0", 9600, heard)
    assert (found is not None) is known
    assert found is None or found.score == 0.8


def test_of_two_protocols_that_which_understands_more_is_proposed() -> None:
    found = guess("/dev/ttyUSB0", 9600, b"+0012345\r\n" * 10 + b"12.5\r\n")
    assert found is not None and (found.protocol, found.score) == ("ascii", 1.0)


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


def even(text: bytes) -> bytes:
    """Seven-bit characters with even parity, as eight bits."""
    return bytes(byte | 0x80 if byte.bit_count() % 2 else byte for byte in text)


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


def test_counts_of_hbm_are_proposed_without_a_scale() -> None:
    finding = found(b"+0012345,31,008\r\n" * 12)
    assert finding.address == "/dev/ttyUSB0?protocol=hbm-aed&baud=9600&bytesize=8&parity=N"
    assert finding.remark.startswith("'+0012345,31,008' is read as 12345: compare")


@pytest.mark.parametrize(("talks_at", "tried"), [(57600, [9600, 115200, 57600]), (0, [*SPEEDS])])
def test_listening_tries_the_usual_speeds_first_and_sends_nothing(talks_at: int, tried: list[int]) -> None:
    ports = Ports(talks_at)
    heard = list(listen("/dev/ttyUSB0", opener=ports, clock=ports.time))
    assert [baud for baud, _, _ in heard] == tried
    finding = heard[-1][2]
    assert (finding and finding.protocol) == ("ascii" if talks_at else None)
    assert all(port.sent == [] and port.closed == 1 for port in ports.opened)
    assert talks_at or ports.time.now == pytest.approx(100 + 8 * 1.5, abs=1.0), "each for a second and a half"


def test_the_speeds() -> None:
    assert SPEEDS == (9600, 115200, 57600, 19200, 2400, 4800, 38400, 1200)


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
    assert (ports.opened[0].sent, ports.opened[0].closed) == ([question(name).data], 1)


@pytest.mark.parametrize("name", QUESTIONS)
def test_no_answer_is_no_finding(name: str) -> None:
    ports = Ports()
    assert ask(question(name), opener=ports, clock=ports.time) is None


def test_what_it_sends_unasked_is_no_answer() -> None:
    time = FakeTime()
    port = FakePort(time, [b"1021.15"], pace=0.01)
    assert ask(question("sauter"), opener=lambda line: port, clock=time) is None
    assert port.sent == [b"9"] and time.now == pytest.approx(101.1, abs=0.15)


@pytest.mark.parametrize(
    ("use", "doing"),
    [
        (lambda opener, time: ask(question("sauter"), opener=opener, clock=time), "asking"),
        (lambda opener, time: record_bytes(LineSettings("/dev/x"), opener=opener, clock=time), "listening"),
    ],
    ids=["asking", "listening"],
)
def test_a_port_that_is_lost_meanwhile(use: Callable[..., object], doing: str) -> None:
    time = FakeTime()
    port = FakePort(time, [OSError(5, "gone")])
    with pytest.raises(DeviceError, match=rf"/dev/x: lost while {doing} \(gone\); check the cable"):
        use(lambda line: port, time)
    assert port.closed == 1
