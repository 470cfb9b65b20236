"""The TCP server of lines with real sockets: answers, tokens, and clients that stall or misbehave."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from acquire.errors import ConfigError
from live.config.listen_address import ListenAddress, read_token
from live.run import tcp_lines
from live.run.tcp_lines import MAX_LINE_BYTES, Client, LineServer
from tests.live.run.test_tokens import connected

WORD = "a-long-and-secret-word"


@contextmanager
def server(**kinds: object) -> Iterator[LineServer]:
    one = LineServer(ListenAddress.parse("0").listen("a test"), **kinds)  # type: ignore[arg-type]
    one.start()
    try:
        yield one
    finally:
        one.close()


class Caller:
    """A client that blocks, with lines."""

    def __init__(self, port: int | Path, receive_buffer: int = 0) -> None:
        self.socket = socket.socket(socket.AF_UNIX if isinstance(port, Path) else socket.AF_INET)
        if receive_buffer:
            self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, receive_buffer)
        self.socket.settimeout(5)
        self.socket.connect(str(port) if isinstance(port, Path) else ("127.0.0.1", port))
        self.lines = self.socket.makefile("r", encoding="utf-8", newline="\n")

    def ask(self, text: str) -> str:
        self.socket.sendall(text.encode() + b"\n")
        return self.lines.readline().rstrip("\n")

    def close(self) -> None:
        self.lines.close()
        self.socket.close()


def test_each_line_is_answered() -> None:
    with server(answer=str.upper) as one:
        caller = Caller(one.port)
        assert [caller.ask("abc"), caller.ask("d e\r"), caller.ask("")] == ["ABC", "D E", ""]
        caller.socket.sendall(b"two\nlines")
        assert caller.lines.readline() == "TWO\n"
        assert caller.ask(" at once") == "LINES AT ONCE"
        caller.close()


def test_without_the_token_nothing_is_heard_or_told() -> None:
    received: list[str] = []
    with server(token=WORD, answer=lambda line: received.append(line) or "ok", greeting="welcome") as one:  # type: ignore[func-returns-value]
        wrong, right = Caller(one.port), Caller(one.port)
        assert wrong.ask("quit").startswith("no: ")
        assert wrong.lines.readline() == ""  # let go
        assert right.ask(f"token {WORD}") == "ok"
        assert right.lines.readline() == "welcome\n"
        assert right.ask("quit") == "ok" and received == ["quit"]
        wrong.close()
        right.close()


def test_lines_to_all_are_for_those_with_the_token() -> None:
    with server(token=WORD, greeting="welcome") as one:
        first, later = Caller(one.port), Caller(one.port)
        assert first.ask(WORD) == "ok" and first.lines.readline() == "welcome\n"
        one.send("strain 1")
        assert first.lines.readline() == "strain 1\n"
        assert later.ask(f"token {WORD}") == "ok" and later.lines.readline() == "welcome\n"
        one.send("strain 2")
        assert [caller.lines.readline() for caller in (first, later)] == ["strain 2\n"] * 2
        first.close()
        later.close()


def test_a_browser_can_order_nothing() -> None:
    received: list[str] = []
    with server(answer=lambda line: received.append(line) or "ok") as one:  # type: ignore[func-returns-value]
        caller = Caller(one.port)
        caller.socket.sendall(b"POST / HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\nquit\n")
        assert caller.lines.readline() == ""
        assert received == []
        caller.close()


def test_a_client_that_stalls_is_skipped_and_counted_and_the_other_gets_all() -> None:
    with server(greeting="0") as one:
        stalled, good = Caller(one.port, receive_buffer=4096), Caller(one.port)
        assert stalled.lines.readline() == good.lines.readline() == "0\n"
        lines = [f"{number} " + "x" * 2000 for number in range(1, 1000)]
        for line in lines:
            one.send(line)
            assert good.lines.readline() == line + "\n"
        good.close()
        got = sum(1 for _ in read_what_is_there(stalled))
    assert one.skipped > 100
    assert one.taken == 2 + len(lines) + (len(lines) - one.skipped)
    stalled.close()
    assert 0 < got <= len(lines) - one.skipped


def read_what_is_there(caller: Caller) -> Iterator[str]:
    caller.socket.settimeout(0.2)
    while True:
        try:
            line = caller.lines.readline()
        except TimeoutError:
            return
        if not line.endswith("\n"):
            return
        assert line[0].isdigit()  # only whole lines
        yield line


@pytest.mark.parametrize(
    "text", ["", "x", "80", "70000", "host:5000", "1.2.3:5000", "5000:", "::1:5000", "-1", "٣٣٣٣"]
)
def test_places_that_cannot_be(text: str) -> None:
    with pytest.raises(ValueError, match="PORT"):
        ListenAddress.parse(text)


def test_beyond_this_machine_only_with_a_token(tmp_path: Path) -> None:
    here, everywhere = ListenAddress.parse("localhost:5000"), ListenAddress.parse("0.0.0.0:5000")
    assert here.is_loopback and not everywhere.is_loopback
    assert read_token(here, None, "it") == ""
    with pytest.raises(ConfigError, match="token_file"):
        read_token(everywhere, None, "it")
    with pytest.raises(ConfigError, match=r"every user can reach 127\.0\.0\.1; give token_file"):
        read_token(here, None, "it", commands=True)
    path = tmp_path / "token"
    path.touch(0o600)
    for bad in ("", "short", "two words that are long"):
        path.write_text(bad)
        with pytest.raises(ConfigError, match="16 letters"):
            read_token(everywhere, str(path), "it")
    path.write_text(WORD + "\n")
    assert read_token(everywhere, str(path), "it") == read_token(here, str(path), "it") == WORD
    for others in (0o640, 0o604, 0o622):
        path.chmod(others)
        with pytest.raises(ConfigError, match="other users can read the token; make a new one, of mode 600"):
            read_token(here, str(path), "it")
    path.chmod(0o600)
    with pytest.raises(ConfigError, match="no token"):
        read_token(here, str(tmp_path / "none"), "it")


def test_a_taken_port_is_told() -> None:
    with server() as one, pytest.raises(ConfigError, match="choose another port"):
        ListenAddress.parse(str(one.port)).listen("it")


def test_lines_of_clients_are_ignored_where_nobody_answers() -> None:
    client: Any = SimpleNamespace(authorized=True)
    server = object.__new__(LineServer)
    server._answer = None
    assert server._handle(client, "hello") and not server._handle(client, "GET / HTTP/1.1")


def test_at_most_so_many_clients_are_served(monkeypatch: pytest.MonkeyPatch) -> None:
    assert (tcp_lines.MAX_CLIENTS, MAX_LINE_BYTES) == (32, 4096)
    monkeypatch.setattr(tcp_lines, "MAX_CLIENTS", 2)
    with server(greeting="hello") as one:
        callers = [Caller(one.port) for _ in range(2)]
        assert [caller.lines.readline() for caller in callers] == ["hello\n"] * 2
        third = Caller(one.port)
        assert third.lines.readline() == ""
        callers[0].close()
        third.close()
        # Its place is free once the server has seen that it is gone.
        while len(one._clients) == 2:
            pass
        fourth = Caller(one.port)
        assert fourth.lines.readline() == "hello\n"
        fourth.close()
        callers[1].close()
    assert one.served == 3


@pytest.mark.parametrize(("length", "good"), [(MAX_LINE_BYTES, True), (MAX_LINE_BYTES + 1, False)])
@pytest.mark.parametrize("end", [b"", b"\n"])
def test_a_line_of_a_client_has_at_most_so_many_bytes(length: int, good: bool, end: bytes) -> None:
    here, there = connected()
    with there:
        client = Client(here, "a client", "")
        there.sendall(b"x" * length + end)
        there.shutdown(socket.SHUT_WR)
        got: list[str] = []
        words = "closed by the client" if good else "a line without an end"
        with pytest.raises(ConnectionError, match=words):
            while True:
                got += client.receive()
        assert got == (["x" * length] if good and end else [])
        client.close()


class Stalling:
    """A connection that takes so many bytes at each send, then none."""

    def __init__(self, *takes: int) -> None:
        self.takes, self.sent = list(takes), b""

    def send(self, data: bytes) -> int:
        take = self.takes.pop(0) if self.takes else 0
        if not take:
            raise BlockingIOError
        self.sent += data[:take]
        return min(take, len(data))

    def setblocking(self, on: bool) -> None: ...

    def setsockopt(self, *given: int) -> None: ...


def test_the_rest_of_a_line_goes_before_the_next_one_and_whole_lines_are_skipped() -> None:
    connection: Any = Stalling(3, 2, 99, 99, 0, 99)
    client = Client(connection, "a client", "")
    assert client.send(b"abcdef\n"), "begun, so it is taken"
    assert not client.send(b"second\n") and connection.sent == b"abcde"
    assert client.send(b"third\n") and connection.sent == b"abcdef\nthird\n"
    assert not client.send(b"fourth\n")
    assert client.send(b"fifth\n") and connection.sent == b"abcdef\nthird\nfifth\n"
    assert (client.taken, client.skipped) == (3, 2)
