"""The proxy passes viewers, refuses foreign pages, and disconnects a viewer that has stopped."""

from __future__ import annotations

import contextlib
import socket
import threading
from collections.abc import Iterator

import pytest

from live.ui.rerun.drawing import proxy as viewer_proxy
from live.ui.rerun.drawing.proxy import ViewerProxy, hidden_address, host_allowed

PREFACE = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n"


@pytest.mark.parametrize(
    ("head", "allowed"),
    [
        (b"PRI * HTTP/2.0\r\n\r\n", True),
        (b"POST /x HTTP/1.1\r\nHost: 127.0.0.1:9876\r\n\r\n", True),
        (b"POST /x HTTP/1.1\r\nhost:LOCALHOST:1\r\n\r\n", True),
        (b"POST /x HTTP/1.1\r\nHost: [::1]:9876\r\n\r\n", True),
        (b"POST /x HTTP/1.1\r\nHost: evil.example:9876\r\n\r\n", False),
        (b"POST /x HTTP/1.1\r\nHost: 127.0.0.1.evil.example\r\n\r\n", False),
        (b"POST /x HTTP/1.1\r\nHost: localhost\r\nHost: evil.example\r\n\r\n", False),
        (b"POST /x HTTP/1.1\r\n\r\n", False),
    ],
)
def test_which_requests_pass(head: bytes, allowed: bool) -> None:
    assert host_allowed(head) is allowed


@pytest.fixture
def server() -> Iterator[socket.socket]:
    """The server behind the proxy: it echoes what it receives."""
    with socket.socket() as listening:
        listening.bind(("127.0.0.1", 0))
        listening.listen()

        def echo() -> None:
            while True:
                try:
                    connection, _ = listening.accept()
                except OSError:
                    return
                # The proxy may end a connection with bytes still under way: a reset, as good an end.
                with connection, contextlib.suppress(ConnectionError):
                    while data := connection.recv(2**16):
                        connection.sendall(data)

        threading.Thread(target=echo, daemon=True).start()
        yield listening
        listening.shutdown(socket.SHUT_RDWR)


def opened(server: socket.socket, messages: list[str]) -> ViewerProxy:
    proxy = ViewerProxy(0, messages.append)
    proxy.open(*server.getsockname())
    return proxy


def test_it_passes_on_both_ways_and_refuses_foreign_pages(server: socket.socket) -> None:
    proxy = opened(server, [])
    with socket.create_connection(("127.0.0.1", proxy.port), 10) as viewer:
        viewer.sendall(PREFACE)
        assert viewer.recv(100).startswith(b"PRI * HTTP/2.0\r\n\r\n")
    with socket.create_connection(("127.0.0.1", proxy.port), 10) as page:
        page.sendall(b"POST /x HTTP/1.1\r\nHost: evil.example\r\n\r\n")
        assert page.recv(100).startswith(b"HTTP/1.1 403")
        assert page.recv(100) == b""


def ended(viewer: socket.socket, proxy: ViewerProxy) -> bool:
    """Whether the proxy disconnects a viewer that receives nothing while more and more is drawn."""
    for k in range(1, 40):
        proxy.drawn(k * (viewer_proxy.STOPPED_BYTES + 1))
        try:
            return viewer.recv(100) == b""
        except TimeoutError:
            continue
        except ConnectionResetError:
            return True
    return False


def test_a_stopped_viewer_is_disconnected(server: socket.socket, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(viewer_proxy, "STOPPED_S", 0.2)
    messages: list[str] = []
    proxy = opened(server, messages)
    with socket.create_connection(("127.0.0.1", proxy.port), 10) as viewer:
        viewer.sendall(PREFACE + b"x" * 20_000)
        received = 0
        while received < len(PREFACE) + 20_000:
            received += len(viewer.recv(2**16))
        viewer.settimeout(0.5)
        assert ended(viewer, proxy)
    assert len(messages) == 1
    assert "disconnected" in messages[0]


def test_no_two_proxies_have_one_port() -> None:
    first = ViewerProxy(0, print)
    second = ViewerProxy(first.port, print)
    assert first.port < second.port < first.port + viewer_proxy.TRIES
    first.close()
    second.close()
    with pytest.raises(OSError, match="no free port from 65536"):
        ViewerProxy(65_536, print)


def test_the_hidden_address_is_of_this_machine_alone() -> None:
    host, port = hidden_address()
    assert host.startswith("127.")
    assert 1024 < port < 65_536
