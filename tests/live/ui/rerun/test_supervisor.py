"""The process of the view: when it starts, restarts and is given up; and its proxy, which refuses foreign pages."""

from __future__ import annotations

import contextlib
import socket
import threading
from collections.abc import Iterator
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from live.ui.rerun import supervisor
from live.ui.rerun.drawing import sinks
from live.ui.rerun.drawing.sinks import ViewerProxy, hidden_address, host_allowed
from live.ui.rerun.messages import ViewTarget
from live.ui.rerun.supervisor import RenderProcess, Stuck, Supervisor
from live.ui.rerun.wire import Kind, Parcel
from tests.clock import Clock

TARGET = ViewTarget(9876, "/a/view.rrd", "id")


class Process:
    """A process that answers what it is told to, and takes what comes."""

    ends = 1

    def __init__(self, clock: Clock) -> None:
        self.pid, self.answers, self.limits = 7, list[Parcel](), list[float]()
        self.gone = False

    def replies(self, seconds: float = 0.0) -> Iterator[Parcel]:
        if self.gone:
            raise EOFError
        answers, self.answers = self.answers, []
        yield from answers

    def may_take(self, seconds: float) -> None:
        self.limits.append(seconds)

    def send(self, message: Parcel) -> None: ...

    def end(self, seconds: float = 0.0) -> int:
        return self.ends


class Watched:
    """A supervisor without its thread, and what it has started, told and been asked for."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.clock, self.told = Clock(), list[tuple[str, str]]()
        self.processes: list[Process] = []
        self.targets: list[ViewTarget] = []
        self.served = 0
        outbox: Any = SimpleNamespace(begin=self.targets.append, next=lambda now: None, end=lambda: None)
        monkeypatch.setattr(supervisor.time, "monotonic", self.clock)
        monkeypatch.setattr(supervisor, "RenderProcess", self.start)
        self.one = Supervisor(
            outbox, TARGET, lambda text, level: self.told.append((level, text)), self.serving
        )
        monkeypatch.setattr(self.one._closing, "wait", lambda seconds: None)

    def serving(self) -> None:
        self.served += 1

    def start(self) -> Process:
        self.processes.append(Process(self.clock))
        return self.processes[-1]

    def step(self, seconds: float = 0.0, *answers: Parcel) -> None:
        self.clock.now_s += seconds
        if answers:
            self.processes[-1].answers += answers
        with self.one._guarded():
            self.one._step()

    def lose(self, seconds: float = 0.0) -> None:
        self.processes[-1].gone = True
        self.step(seconds)


@pytest.fixture
def watched(monkeypatch: pytest.MonkeyPatch) -> Watched:
    return Watched(monkeypatch)


def serving(port: int | None = 9877, rrd: str | None = "/a/view.rrd") -> Parcel:
    return Parcel(Kind.SERVING, {"port": port, "rrd": rrd})


def test_it_serves_once_the_process_says_so(watched: Watched) -> None:
    one = watched.one
    watched.step()
    assert (one.served.port, one.served.rrd, one.pid, watched.served) == (None, None, 7, 0)
    watched.step(0.1, serving())
    assert (one.served, watched.served) == (replace(TARGET, port=9877), 1)
    watched.step(0.1, Parcel(Kind.TROUBLE, {"text": "a word", "lasting": False}))
    assert watched.told == [("warning", "a word")] and one.failed == ""
    watched.step(0.1, Parcel(Kind.TROUBLE, {"text": "no place", "lasting": True}))
    assert one.failed == "no place"


def test_it_is_restarted_on_its_port_with_a_new_file(watched: Watched) -> None:
    watched.step()
    watched.step(0.1, serving())
    watched.lose(1.0)
    assert watched.told == [("warning", "the view's process ended with 1 and is restarted")]
    assert watched.one.pid is None
    watched.step(0.9)
    assert len(watched.processes) == 1, "a second later"
    watched.step(0.2)
    assert len(watched.processes) == 2
    assert watched.targets == [TARGET, ViewTarget(9877, "/a/view-2.rrd", "id")]
    watched.step(0.1, serving(9900, "/a/view-2.rrd"))
    assert watched.told[1:] == [("warning", "the view is now on port 9900")] and watched.served == 2


def test_each_failure_in_a_row_waits_twice_as_long(watched: Watched) -> None:
    watched.step()
    watched.step(0.0, serving())
    for delay in (1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 60.0, 60.0):
        count = len(watched.processes)
        watched.lose()
        watched.step(0.99 * delay)
        assert len(watched.processes) == count, delay
        watched.step(0.02 * delay)
        assert len(watched.processes) == count + 1, delay
        watched.step(0.0, serving())
    assert [level for level, _ in watched.told] == ["warning"] * 3, "three are reported"
    assert watched.told[-1][1].endswith("is restarted; further restarts are not reported")
    watched.lose(61.0)
    assert watched.one._restart_t - watched.clock.now_s == 1.0, "it had run for a minute"


def test_one_that_never_starts_is_given_up(watched: Watched) -> None:
    for _ in range(5):
        assert watched.one.failed == ""
        watched.step(100.0)
        watched.lose()
    assert watched.one.failed == "its process does not start (ended with 1)" and watched.one.starts == 5


def test_one_that_takes_nothing_is_stuck_sooner_once_it_serves(watched: Watched) -> None:
    watched.step()
    watched.step(0.0, serving())
    assert watched.processes[0].limits == [15.0], "a busy machine starts one slowly"


def test_one_that_takes_nothing_is_replaced(monkeypatch: pytest.MonkeyPatch) -> None:
    ours, theirs = socket.socketpair()
    monkeypatch.setattr(supervisor, "start_with_socket", lambda *_: (SimpleNamespace(pid=7), ours))
    monkeypatch.setattr(supervisor, "START_S", 0.2)
    process = RenderProcess()
    with ours, theirs:
        with pytest.raises(Stuck, match="took nothing for 0 s"):
            while True:
                process.send(Parcel(Kind.STATUS, {"markdown": "a" * 1000}))
        process._pipe.close()


def test_one_that_has_grown_is_restarted_at_once(watched: Watched) -> None:
    watched.step()
    watched.step(0.0, serving())
    watched.step(0.0, Parcel(Kind.FULL, {"memory_MiB": 650}))
    watched.lose()
    assert watched.told == [("info", "the view's process had grown to 650 MiB and is restarted")]
    watched.step()
    assert len(watched.processes) == 2


def test_a_signal_is_named(watched: Watched, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Process, "ends", -9)
    watched.step()
    watched.lose()
    assert watched.told == [("warning", "the view's process was ended by SIGKILL and is restarted")]


def test_at_its_end_it_is_done_or_told(watched: Watched) -> None:
    watched.step()
    watched.step(0.0, serving(), Parcel(Kind.ENDED))
    watched.one._finish(5.0)
    assert watched.told == [] and watched.one.pid is None


def test_one_that_ends_early_may_lack_seconds(watched: Watched) -> None:
    watched.step()
    watched.processes[-1].gone = True
    watched.one._finish(5.0)
    assert watched.told == [
        ("warning", "the view's process ended early (1); its file may lack the last seconds")
    ]
    watched.told.clear()
    watched.one._is_done, watched.one._cause = False, ""
    watched.one._finish(0.0)
    assert watched.told[0][1].startswith("the view's process did not finish in time and was ended (1)")


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
        proxy.drawn(k * (sinks.STOPPED_BYTES + 1))
        try:
            return viewer.recv(100) == b""
        except TimeoutError:
            continue
        except ConnectionResetError:
            return True
    return False


def test_a_stopped_viewer_is_disconnected(server: socket.socket, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sinks, "STOPPED_S", 0.2)
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
    assert first.port < second.port < first.port + sinks.TRIES
    first.close()
    second.close()
    with pytest.raises(OSError, match="no free port from 65536"):
        ViewerProxy(65_536, print)


def test_the_hidden_address_is_of_this_machine_alone() -> None:
    host, port = hidden_address()
    assert host.startswith("127.")
    assert 1024 < port < 65_536
