"""Ports as bytes: limits of a read, and terminal servers by RFC 854 and 2217."""

from __future__ import annotations

import socket
from collections.abc import Iterator

import pytest

from acquire.errors import DeviceError
from acquire.serial_line.byte_ports import Rfc2217Port, Telnet, TtyPort, line_settings, setting
from acquire.serial_line.ports import LineSettings, open_port


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
    monkeypatch.setattr("acquire.serial_line.byte_ports.CONNECT_S", 0.02)
    made = Server(answers, monkeypatch)
    with pytest.raises(DeviceError) as caught:
        Rfc2217Port("127.0.0.1", made.number, line_settings(9600, 8, "N", 1), 0.1)
    assert str(caught.value) == f"the other side {words}"
    made.end.close()
    made.listening.close()
