"""An adapter that sends back what is written to it: taken out for every polled protocol; an answer never is."""

from __future__ import annotations

import math

import pytest

from acquire.addresses import Options, parse_address
from acquire.load_sample import LoadFlag, LoadSample
from acquire.protocols.base import find_protocol
from acquire.protocols.modbus import frame
from acquire.serial_line.arrivals import Echo
from tests.acquire.serial_line.fake_port import SILENCE, FakeLine

VALUE = 12.31
LINES = "protocol=lines&unit=N&pattern=(%3FP<value>[-+0-9.]%2B)&poll="
POLLED: dict[str, tuple[str, bytes, bytes]] = {
    "mt-sics": ("protocol=mt-sics&mode=poll", b"SI\r\n", b"S S     12.31 N\r\n"),
    "mark10": ("protocol=mark10&mode=poll&sign=1", b"?C\r", b"12.31 N\r\n"),
    "sauter": ("protocol=sauter&unit=N", b"9", b"1012.31"),
    "hbm-aed": ("protocol=hbm-aed&mode=poll&unit=N&decimals=2", b"MSV?;", b"00001231\r\n"),
    "aed-standard": ("protocol=aed-standard&mode=poll&unit=N", b"Q\r\n", b"ST,GS,+0012.31 N\r\n"),
    "modbus": (
        "protocol=modbus&profile=pt113&unit=N&scale=0.01", b"", frame(1, 3, 6, words=(0, 1231, 2)),
    ),
    "lines": (LINES + "W\\r&mode=poll", b"W\r", b"12.31\r\n"),
    "lines, a poll that is a value": (LINES + "0\\r&mode=poll", b"0\r", b"12.31\r\n"),
}  # fmt: skip


def poll_of(name: str) -> bytes:
    address, poll, _ = POLLED[name]
    options = Options(parse_address(f"/dev/fake?{address}"))
    return poll or find_protocol("modbus").make_parser(options).commands["poll"]


def polled(name: str, echo: bytes, answer: bytes, rounds: int = 12) -> tuple[FakeLine, list[LoadSample]]:
    """A cell that asks so many times, and what it makes of echo and answer."""
    address, poll = f"/dev/fake?{POLLED[name][0]}", poll_of(name)
    line = FakeLine([SILENCE] * rounds, address=address, answers={poll: echo + answer})
    with line.cell:
        return line, line.passes(rounds)


def values(samples: list[LoadSample]) -> list[float]:
    return [sample.force for sample in samples]


@pytest.mark.parametrize("name", POLLED)
def test_an_echo_is_taken_out_and_told_once(name: str) -> None:
    line, samples = polled(name, poll_of(name), POLLED[name][2], 30)
    got = values(samples)
    good = [force for force in got if not math.isnan(force)]
    assert len(good) >= 10 and good[-9:] == pytest.approx([VALUE] * 9)
    assert got[-9:] == good[-9:], "every answer is a value once the echo is known"
    assert not any(LoadFlag.ERROR in sample.flags for sample in samples[2:])
    assert sum("echo" in text for text in line.told) == 1


@pytest.mark.parametrize("name", POLLED)
def test_without_an_echo_nothing_is_taken(name: str) -> None:
    line, samples = polled(name, b"", POLLED[name][2], 30)
    good = [force for force in values(samples) if not math.isnan(force)]
    assert len(good) >= 10 and good == pytest.approx([VALUE] * len(good))
    assert not any("echo" in text for text in line.told)


def test_an_answer_that_is_the_poll_itself_is_kept() -> None:
    line, samples = polled("lines, a poll that is a value", b"", b"0\r", 40)
    assert len(values(samples)) >= 8 and set(values(samples)) == {0.0}
    assert not any("echo" in text for text in line.told)


def test_behind_an_echo_an_answer_that_is_the_poll_is_kept_too() -> None:
    line, samples = polled("lines, a poll that is a value", b"0\r", b"0\r", 40)
    assert set(values(samples)[-8:]) == {0.0}
    assert sum("echo" in text for text in line.told) == 1


def test_an_echo_without_an_answer_is_silence() -> None:
    parser = find_protocol("mt-sics").make_parser(Options(parse_address("/dev/fake")))
    parser.feed(b"\r\n")
    echo = Echo(parser, lambda level, text: None)
    for answer in (b"S S     1.00 N\r\n", b"", b""):
        echo.sent(b"SI\r\n")
        assert echo.take(b"SI\r\n" + answer) + echo.release() == answer


def pieces(data: bytes, *cuts: int) -> list[bytes]:
    return [data[a:b] for a, b in zip((0, *cuts), (*cuts, len(data)), strict=True) if data[a:b]]


@pytest.mark.parametrize("name", [name for name in POLLED if name != "modbus"])
def test_an_echo_may_come_in_pieces_or_with_the_answer(name: str) -> None:
    address, poll, answer = POLLED[name]
    protocol = find_protocol(address.partition("&")[0].removeprefix("protocol="))
    for first in range(len(poll + answer)):
        for second in range(first, len(poll + answer)):
            parser = protocol.make_parser(Options(parse_address(f"/dev/fake?{address}")))
            parser.feed(b"\r\n" if name != "sauter" else b"")
            echo = Echo(parser, lambda level, text: None)
            for _ in range(3):
                echo.sent(poll)
                passed = [echo.take(piece) for piece in pieces(poll + answer, first, second)]
                assert b"".join([*passed, echo.release()]) == answer, (first, second)
                parser.feed(answer)
                parser.silence()
            assert echo.known


def test_an_answer_that_begins_with_the_poll_is_kept_in_any_pieces() -> None:
    """A device that names what it was asked: nothing of it is an echo."""
    address = "/dev/fake?protocol=lines&unit=N&pattern=W(%3FP<value>[0-9.]%2B)&poll=W&mode=poll"
    for first in range(8):
        parser = find_protocol("lines").make_parser(Options(parse_address(address)))
        parser.feed(b"\r\n")
        echo = Echo(parser, lambda level, text: None)
        for _ in range(3):
            echo.sent(b"W")
            passed = [echo.take(piece) for piece in pieces(b"W12.31\r\n", first)]
            assert b"".join([*passed, echo.release()]) == b"W12.31\r\n"
        assert not echo.known


def test_a_poll_that_may_be_the_first_digit_of_the_answer_is_left_and_named(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """10.5 may be 10.5, or an echo of 1 before 0.5."""
    monkeypatch.setitem(POLLED, "digit", (LINES + "1&mode=poll", b"1", b"0.5\r\n"))
    line, samples = polled("digit", b"1", b"0.5\r\n")
    assert set(values(samples)) == {10.5}
    assert sum("if the adapter echoes" in text for text in line.told) == 1


def test_what_only_began_like_the_echo_is_given_back() -> None:
    parser = find_protocol("mt-sics").make_parser(Options(parse_address("/dev/fake")))
    parser.feed(b"\r\n")
    echo = Echo(parser, lambda level, text: None)
    for _ in range(2):
        echo.sent(b"SI\r\n")
        assert echo.take(b"SI\r\n") + echo.take(b"S S     1.00 N\r\n") == b"S S     1.00 N\r\n"
    echo.sent(b"SI\r\n")
    assert echo.take(b"S") == b"" and echo.take(b" S     2.00 N\r\n") == b"S S     2.00 N\r\n"
    assert not echo.known, "the adapter is another one now"
