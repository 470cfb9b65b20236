"""Serial ports: their list and identity, opening and reading one, finding its protocol, and Telnet with RFC 2217."""

from __future__ import annotations

import contextlib
import errno
import math
import os
import pty
import tty
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquire.addresses import Options, parse_address
from acquire.errors import ConfigError, DeviceError
from acquire.protocols.base import find_protocol
from acquire.serial_line import ports as serial_ports
from acquire.serial_line.byte_ports import Telnet, escaped, line_settings
from acquire.serial_line.identify import Question, ask, guess, listen, questions, record_bytes
from acquire.serial_line.ports import LineSettings, find_again, identity_of, list_serial_ports, open_port
from tests.acquire.serial_line.fake_port import FakePort, FakeTime
from tests.adversary.peers import LINE, Rfc2217Peer, SocketPeer, paced, silence


@dataclass(order=True)
class Listed:
    device: str
    description: str = "n/a"
    vid: int | None = None
    pid: int | None = None
    serial_number: str | None = None


@pytest.fixture
def listed(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[Listed]]:
    from serial.tools import list_ports

    ports = [
        Listed("/dev/ttyS0"),
        Listed("/dev/ttyUSB1", "FT232R", 0x0403, 0x6001, "A1"),
        Listed("/dev/ttyACM0", "Uno", 0x2341, 0x43, None),
    ]
    monkeypatch.setattr(list_ports, "comports", lambda: list(ports))
    yield ports


def test_the_list(listed: list[Listed]) -> None:
    ports = {port.device: port for port in list_serial_ports()}
    assert ports["/dev/ttyUSB1"].identity == "0403:6001:A1"
    assert "FT232R" in ports["/dev/ttyUSB1"].text()
    assert ports["/dev/ttyS0"].identity == ""


def test_a_device_is_found_under_its_new_name(listed: list[Listed]) -> None:
    identity = identity_of("/dev/ttyUSB1")
    listed[1] = Listed("/dev/ttyUSB7", "FT232R", 0x0403, 0x6001, "A1")
    assert find_again("/dev/ttyUSB1", identity) == "/dev/ttyUSB7"
    assert find_again("/dev/ttyS0", "") == "/dev/ttyS0"


def test_two_devices_alike_are_not_mixed_up(listed: list[Listed]) -> None:
    listed += [Listed("/dev/ttyACM1", "Uno", 0x2341, 0x43, None)]
    assert find_again("/dev/ttyACM9", "2341:0043:") == "/dev/ttyACM9"


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (OSError(errno.EACCES, "denied"), "usermod"),
        (OSError(errno.EBUSY, "busy"), "another program has it open"),
        (OSError(errno.ENOENT, "gone"), "there is no such port; serial ports here: /dev/ttyACM0"),
    ],
)
def test_why_not(error: OSError, words: str, listed: list[Listed], monkeypatch: pytest.MonkeyPatch) -> None:
    import serial

    def refuse(*args: object, **keys: object) -> None:
        raise error

    monkeypatch.setattr(serial, "serial_for_url", refuse)
    with pytest.raises(DeviceError) as caught:
        open_port(LineSettings("/dev/ttyNONE"))
    assert words in str(caught.value) and "/dev/ttyNONE" in str(caught.value)


def test_a_port_that_is_open_already_is_busy() -> None:
    import os

    master, slave = pty.openpty()
    name = os.ttyname(slave)
    first = open_port(LineSettings(name))
    with pytest.raises(DeviceError, match="another program"):
        open_port(LineSettings(name))
    first.close()
    os.close(master)
    os.close(slave)


def test_all_that_waits_comes_without_a_pause() -> None:
    """Behind a full buffer of 4 kB Linux holds 64 kB, which a worker of the kernel moves when it likes."""
    master, slave = pty.openpty()
    tty.setraw(slave)
    os.set_blocking(master, False)
    port = open_port(LineSettings(os.ttyname(slave)))
    for _ in range(100):
        sent, received = 0, 0
        with contextlib.suppress(BlockingIOError):
            while sent < 60_000:
                sent += os.write(master, b"x" * 1000)
        while data := port.receive(1 << 16, wait=False):
            received += len(data)
        assert received == sent > 4096
    port.close()
    os.close(master)
    os.close(slave)


def test_an_impossible_line_is_a_matter_of_configuration() -> None:
    with pytest.raises(ConfigError):
        open_port(LineSettings("loop://", bytesize=9))


@pytest.mark.parametrize(
    ("line", "byte_time_s"),
    [
        (LineSettings("/dev/ttyUSB0", 9600), 10 / 9600),
        (LineSettings("/dev/ttyUSB0", 2400, 7, "E"), 10 / 2400),
        (LineSettings("/dev/ttyUSB0", 9600, 8, "E", 2), 12 / 9600),
        (LineSettings("socket://host:1", 9600), 0.0),
    ],
)
def test_time_of_a_byte(line: LineSettings, byte_time_s: float) -> None:
    assert line.byte_time_s == pytest.approx(byte_time_s)


def test_a_pty_has_no_wire(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(serial_ports.os, "path", SimpleNamespace(realpath=lambda p: "/dev/pts/3"))
    assert LineSettings(str(tmp_path / "tty")).byte_time_s == 0.0


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
        record_bytes(
            LineSettings("/dev/x"), opener=lambda line: FakePort(time, [OSError(5, "gone")]), clock=time
        )


@given(data=st.binary(max_size=300), cuts=st.lists(st.integers(1, 40), min_size=1, max_size=20))
def test_escaped_data_comes_back_however_it_is_cut(data: bytes, cuts: list[int]) -> None:
    telnet, sent, out = Telnet(), escaped(data), bytearray()
    while sent:
        size = cuts[len(sent) % len(cuts)]
        out += telnet.feed(sent[:size])
        sent = sent[size:]
    assert bytes(out) == data


@given(
    data=st.lists(st.sampled_from([b"\xff", b"\xfa", b"\xf0", b"\xfb", b"\x2c", b"\xfd", b"1"]), max_size=400)
)
def test_no_server_makes_it_grow_or_fail(data: list[bytes]) -> None:
    telnet = Telnet()
    for byte in data:
        telnet.feed(byte)
    assert len(telnet.replies) <= 3 * 512 and len(telnet._begun) <= 64


def test_a_negotiation_without_end_is_let_go() -> None:
    telnet = Telnet()
    telnet.feed(b"\xff\xfa" + b"x" * 100_000)
    assert len(telnet._begun) <= 64
    assert telnet.feed(b"1 N\r\n").endswith(b"1 N\r\n")


def test_offers_are_answered_once() -> None:
    telnet = Telnet()
    telnet.feed(b"\xff\xfd\x18" * 50 + b"\xff\xfb\x01" * 50)
    assert telnet.take_replies() == b"\xff\xfc\x18\xff\xfe\x01"


def test_the_settings_of_the_line() -> None:
    sent = line_settings(9600, 7, "E", 2)
    assert sent.startswith(b"\xff\xfa\x2c\x01\x00\x00\x25\x80\xff\xf0\xff\xfa\x2c\x02\x07\xff\xf0")


def test_a_server_gives_its_lines() -> None:
    with Rfc2217Peer(paced(200.0)) as peer:
        port = open_port(LineSettings(peer.url, 19200, 7, "E"))
        heard = b"".join(port.receive(100) for _ in range(20))
        port.write(b"\xff")
        port.close()
    assert LINE * 3 in heard


def test_what_speaks_no_rfc2217_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("acquire.serial_line.byte_ports.CONNECT_S", 0.1)
    with SocketPeer(silence) as peer:
        url = peer.url.replace("socket", "rfc2217")
        with pytest.raises(DeviceError, match="speaks no RFC 2217; use socket://"):
            open_port(LineSettings(url))
