"""Ports as bytes: limits of a read, TCP connections, and terminal servers by RFC 854 and 2217."""

from __future__ import annotations

import socket
from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquire.errors import DeviceError
from acquire.serial_line import byte_ports
from acquire.serial_line.byte_ports import (
    TcpPort,
    Telnet,
    TtyPort,
    escaped,
    line_settings,
    setting,
)
from acquire.serial_line.ports import LineSettings, open_port
from tests.adversary.peers import LINE, Rfc2217Peer, paced


class Waiting:
    """A port of pyserial in which these bytes wait."""

    def __init__(self, data: bytes) -> None:
        self.data = data

    def read(self, size: int) -> bytes:
        taken, self.data = self.data[:size], self.data[size:]
        return taken

    @property
    def in_waiting(self) -> int:
        return len(self.data)

    def fileno(self) -> int:
        import io

        raise io.UnsupportedOperation


@pytest.mark.parametrize("wait", [True, False])
def test_a_read_takes_no_more_than_it_may(wait: bool) -> None:
    port = TtyPort(Waiting(b"123456789"))
    assert [port.receive(4, wait=wait) for _ in range(4)] == [b"1234", b"5678", b"9", b""]


@pytest.fixture
def ends(monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[TcpPort, socket.socket]]:
    with socket.create_server(("127.0.0.1", 0)) as listening:
        port = TcpPort("127.0.0.1", listening.getsockname()[1], 0.01)
        end, _ = listening.accept()
        yield port, end
        end.close()
        port.close()


def test_a_connection_gives_what_is_there_up_to_the_limit(ends: tuple[TcpPort, socket.socket]) -> None:
    port, end = ends
    assert port.receive(10) == b"" and port.receive(10, wait=False) == b""
    end.sendall(b"1234567")
    assert port.receive(4) + port.receive(4) == b"1234567"
    port.wake()
    end.sendall(b"8")
    assert port.receive(4) == b"8", "woken, and something has come"
    port.write(b"command")
    assert end.recv(100) == b"command"
    option = port._socket.getsockopt
    assert option(socket.IPPROTO_TCP, socket.TCP_NODELAY) and option(socket.SOL_SOCKET, socket.SO_KEEPALIVE)


def test_a_peer_that_takes_nothing_is_gone(
    ends: tuple[TcpPort, socket.socket], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(byte_ports, "WRITE_S", 0.01)
    with pytest.raises(TimeoutError, match="the other side takes no commands"):
        ends[0].write(bytes(1 << 26))


def test_a_wait_lasts_as_long_as_the_address_says() -> None:
    assert (byte_ports.CONNECT_S, byte_ports.WRITE_S) == (3.0, 0.5)


def command(number: int, *value: int) -> bytes:
    """As RFC 2217 writes it: IAC SB COM-PORT-OPTION number value IAC SE."""
    return bytes([255, 250, 44, number, *value, 255, 240])


CONTROL = command(5, 1) + command(5, 8) + command(5, 11)
"""No flow control, DTR on, RTS on."""


@pytest.mark.parametrize(
    ("parity", "stopbits", "values"),
    [("N", 1, (1, 1)), ("O", 2, (2, 2)), ("E", 1.5, (3, 3))],
)
def test_a_line_is_set_with_the_numbers_of_the_rfc(
    parity: str, stopbits: float, values: tuple[int, int]
) -> None:
    assert line_settings(115200, 7, parity, stopbits) == (
        command(1, 0, 1, 0xC2, 0) + command(2, 7) + command(3, values[0]) + command(4, values[1]) + CONTROL
    )


def test_a_byte_of_255_within_a_number_is_doubled() -> None:
    assert setting(1, 255, 4) == command(1, 0, 0, 0, 255, 255)


def test_data_come_out_of_the_commands_around_them() -> None:
    telnet = Telnet()
    assert telnet.feed(b"a\xff\xffb" + command(101, 0, 0, 1, 0) + b"c\xff\xf1d\xff\xfd\x18e") == b"a\xffbcde"
    assert telnet.answered == {1} and telnet.take_replies() == b"\xff\xfc\x18"
    assert telnet.take_replies() == b""


@pytest.mark.parametrize("cut", range(1, 9))
def test_an_answer_may_come_in_two_pieces(cut: int) -> None:
    telnet, sent = Telnet(), command(102, 8) + b"1\r"
    assert telnet.feed(sent[:cut]) + telnet.feed(sent[cut:]) == b"1\r"
    assert telnet.answered == {2}


@pytest.mark.parametrize(
    ("sent", "willing", "reply"),
    [
        (b"\xff\xfb\x2c", True, b"\xff\xfd\x2c"),
        (b"\xff\xfd\x2c", True, b"\xff\xfb\x2c"),
        (b"\xff\xfc\x2c\xff\xfe\x2c", False, b""),
        (b"\xff\xfb\x03\xff\xfd\x00", False, b"\xff\xfd\x03\xff\xfb\x00"),
        (b"\xff\xfb\x01\xff\xfd\x1f", False, b"\xff\xfe\x01\xff\xfc\x1f"),
    ],
)
def test_options_are_agreed_to_or_refused(sent: bytes, willing: bool, reply: bytes) -> None:
    telnet = Telnet()
    assert telnet.feed(sent) == b""
    assert (telnet.willing, telnet.take_replies()) == (willing, reply)


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


OFFER = b"\xff\xfb\x2c\xff\xfd\x2c\xff\xfb\x00\xff\xfd\x00\xff\xfd\x03"


class Server:
    """A terminal server that has answered before it is asked."""

    def __init__(self, answers: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
        listening, connect = socket.create_server(("127.0.0.1", 0)), socket.create_connection

        def accepted(address: tuple[str, int], timeout: float) -> socket.socket:
            ours = connect(address, timeout)
            self.end = listening.accept()[0]
            self.end.settimeout(5)
            self.end.sendall(answers)
            return ours

        monkeypatch.setattr(socket, "create_connection", accepted)
        self.listening, self.end = listening, listening
        self.number: int = listening.getsockname()[1]

    def heard(self, count: int) -> bytes:
        data = b""
        while len(data) < count:
            data += self.end.recv(count - len(data))
        return data


ANSWERS = b"\xff\xfb\x2c" + b"".join(command(100 + k, 0) for k in (1, 2, 3, 4))


@pytest.fixture
def server(monkeypatch: pytest.MonkeyPatch) -> Iterator[Server]:
    made = Server(ANSWERS, monkeypatch)
    yield made
    made.end.close()
    made.listening.close()


def test_a_terminal_server_gets_the_offer_the_line_and_data_with_every_255_doubled(server: Server) -> None:
    port = open_port(LineSettings(f"rfc2217://127.0.0.1:{server.number}", 9600, 8, "E", 2))
    line = command(1, 0, 0, 0x25, 0x80) + command(2, 8) + command(3, 3) + command(4, 2) + CONTROL
    assert server.heard(len(OFFER + line)) == OFFER + line
    port.write(b"a\xffb")
    assert server.heard(4) == b"a\xff\xffb"
    server.end.sendall(b"1\xff\xff2")
    assert port.receive(100) == b"1\xff2"
    port.wake()
    assert port.receive(100) == b"", "woken"
    server.end.close()
    with pytest.raises(ConnectionError, match="the other side closed the connection"):
        port.receive(100)
    port.close()


@pytest.mark.parametrize(
    ("answers", "words"),
    [
        (b"12.5 N\r\n", "speaks no RFC 2217; use socket:// for a plain connection"),
        (ANSWERS[: -len(command(104, 0))], "does not answer to the settings of the line"),
    ],
)
def test_a_server_that_does_not_answer_is_named(
    answers: bytes, words: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(byte_ports, "CONNECT_S", 0.02)
    made = Server(answers, monkeypatch)
    url = f"rfc2217://127.0.0.1:{made.number}"
    with pytest.raises(DeviceError) as caught:
        open_port(LineSettings(url))
    assert str(caught.value) == f"{url}: the other side {words}"
    made.end.close()
    made.listening.close()


def test_a_server_of_pyserial_gives_its_lines() -> None:
    with Rfc2217Peer(paced(200.0)) as peer:
        port = open_port(LineSettings(peer.url, 19200, 7, "E"))
        heard = b"".join(port.receive(100) for _ in range(20))
        port.write(b"\xff")
        port.close()
    assert LINE * 3 in heard
