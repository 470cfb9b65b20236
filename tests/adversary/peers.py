"""Peers on the other end of a load cell's line that send what a test needs: on a pty, a socket, and by RFC 2217."""

from __future__ import annotations

import contextlib
import math
import os
import pty
import socket
import threading
import time
import tty
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any

import serial
from serial.rfc2217 import PortManager

from acquire.opening import Closing

LINE = b"12.5 N\r\n"
Write = Callable[[bytes], None]
Talk = Callable[[Write, threading.Event], None]


def flood(write: Write, stopped: threading.Event) -> None:
    """As much as the line takes."""
    while not stopped.is_set():
        write(LINE * 500)


def flood_without_end(write: Write, stopped: threading.Event) -> None:
    """A line that never ends, as fast as the line takes it."""
    while not stopped.is_set():
        write(b"1" * 4000)


def paced(rate: float, lines: int = 1) -> Talk:
    """So many lines a second, ``lines`` in each write."""

    def talk(write: Write, stopped: threading.Event) -> None:
        due = time.monotonic()
        while not stopped.is_set():
            write(LINE * lines)
            due += lines / rate
            stopped.wait(max(due - time.monotonic(), 0.0))

    return talk


def drip(write: Write, stopped: threading.Event) -> None:
    """One byte at a time."""
    while not stopped.wait(0.01):
        write(b"1")


def silence(write: Write, stopped: threading.Event) -> None:
    """Nothing."""
    stopped.wait()


def leave(write: Write, stopped: threading.Event) -> None:
    """A line, and the connection is closed."""
    write(LINE)


TALKS: dict[str, Talk] = {
    "flood": flood,
    "flood without end": flood_without_end,
    "drip": drip,
    "silence": silence,
    "closed": leave,
}


class Peer(Closing, ABC):
    """Runs ``talk`` for every connection, in a thread.

    Attributes
    ----------
    url : str
        What to open.
    connections : int
        How often somebody came.
    """

    url = ""

    def __init__(self, talk: Talk) -> None:
        self._talk, self._stopped, self.connections = talk, threading.Event(), 0
        self._thread = threading.Thread(target=self._work, daemon=True)
        self._thread.start()

    @abstractmethod
    def _work(self) -> None:
        """Take connections, and talk to each."""

    def _speak(self, write: Write) -> None:
        self.connections += 1
        with contextlib.suppress(OSError):
            self._talk(write, self._stopped)

    def close(self) -> None:
        """End the talk and hang up."""
        self._stopped.set()
        self._thread.join(5)


class PtyPeer(Peer):
    """On a pseudo-terminal; there is one connection."""

    def __init__(self, talk: Talk) -> None:
        self._master, self._slave = pty.openpty()
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self.url = os.ttyname(self._slave)
        super().__init__(talk)

    def _work(self) -> None:
        self._speak(self._write)
        if not self._stopped.is_set():  # hung up
            time.sleep(0.2)  # until somebody has opened it
            os.close(self._slave)
            os.close(self._master)
            self._master = -1

    def _write(self, data: bytes) -> None:
        while data and not self._stopped.is_set():
            try:
                data = data[os.write(self._master, data) :]
            except BlockingIOError:
                self._stopped.wait(0.001)

    def close(self) -> None:
        """Also close the terminal."""
        super().close()
        if self._master >= 0:
            os.close(self._master)
            os.close(self._slave)


class SocketPeer(Peer):
    """A server on this machine; one connection at a time."""

    scheme = "socket"

    def __init__(self, talk: Talk) -> None:
        self._server = socket.create_server(("127.0.0.1", 0))
        self._server.settimeout(0.05)
        self.url = f"{self.scheme}://127.0.0.1:{self._server.getsockname()[1]}"
        super().__init__(talk)

    def _work(self) -> None:
        while not self._stopped.is_set():
            with contextlib.suppress(TimeoutError):
                connection, _ = self._server.accept()
                connection.settimeout(0.2)
                with connection:
                    self._serve(connection)
        self._server.close()

    def _serve(self, connection: socket.socket) -> None:
        self._speak(lambda data: self._send(connection, data))

    def _send(self, connection: socket.socket, data: bytes) -> None:
        while data and not self._stopped.is_set():
            with contextlib.suppress(TimeoutError):
                data = data[connection.send(data) :]


class Rfc2217Peer(SocketPeer):
    """The same, by Telnet with RFC 2217, by pyserial's own server."""

    scheme = "rfc2217"

    def _serve(self, connection: socket.socket) -> None:
        sending = threading.Lock()

        class Wire:
            def write(self, data: bytes) -> None:
                with sending, contextlib.suppress(OSError):
                    connection.sendall(data)

        with serial.serial_for_url("loop://", timeout=0) as port:
            manager = PortManager(port, Wire())
            listening = threading.Thread(target=self._listen, args=(connection, manager), daemon=True)
            listening.start()

            def write(data: bytes) -> None:
                with sending:
                    self._send(connection, data.replace(b"\xff", b"\xff\xff"))

            time.sleep(0.05)  # until the peer is known
            self._speak(write)
            with contextlib.suppress(OSError):
                connection.shutdown(socket.SHUT_RDWR)
            listening.join(5)

    def _listen(self, connection: socket.socket, manager: Any) -> None:
        while not self._stopped.is_set():
            try:
                data = connection.recv(1024)
            except TimeoutError:
                continue
            except OSError:
                return
            if not data:
                return
            for _ in manager.filter(data):
                pass


PEERS: dict[str, type[Peer]] = {"pty": PtyPeer, "socket": SocketPeer, "rfc2217": Rfc2217Peer}


def stamped(rate: float, stall_at: float = math.inf, stall_s: float = 0.0) -> Talk:
    """Lines whose value is the time at which they were due, s; some wait for ``stall_s`` somewhere on the way."""

    def talk(write: Write, stopped: threading.Event) -> None:
        begun, sent = time.monotonic(), 0
        while not stopped.is_set():
            now = time.monotonic()
            if stall_at < now - begun < stall_at + stall_s:
                stopped.wait(0.01)
                continue
            due = int((now - begun) * rate)
            write(b"".join(b"%.4f N\r\n" % (begun + k / rate) for k in range(sent, due)))
            sent = due
            stopped.wait(1 / rate)

    return talk
