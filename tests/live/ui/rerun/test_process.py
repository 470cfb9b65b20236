"""The loop of the drawing process: what each message draws, what it answers, and when it ends."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from acquire.events import Event, EventKind
from acquire.text import Message
from acquire.text.message import from_json
from live.pipeline.snapshot import Snapshot
from live.ui.rerun.drawing import process
from live.ui.rerun.drawing.sinks import ALL, Rates, RerunSink, serve, write
from live.ui.rerun.messages import (
    PictureMessage,
    ViewSetup,
    ViewTarget,
    events_message,
    field_message,
    figures_message,
    picture_message,
    rows_message,
    setup_message,
)
from live.ui.rerun.wire import Kind, MessagePipe, Parcel
from tests.live.made_up import START, make_frame, make_grid, make_measurement
from tests.live.made_up import figures as live_figures

SETUP = ViewSetup("a test", 128, 96, 12, make_grid(), START)


class Scene:
    """Keeps what it was told to draw."""

    def __init__(self) -> None:
        self.told: list[tuple[str, Any]] = []

    def __getattr__(self, name: str) -> Any:
        return lambda *given: self.told.append((name, given))


class Channel:
    """Keeps what was answered."""

    def __init__(self) -> None:
        self.sent: list[tuple[Kind, dict[str, Any]]] = []

    def send(self, kind: Kind, **meta: Any) -> None:
        self.sent.append((kind, meta))

    def notify(self, text: str) -> None:
        self.send(Kind.TROUBLE, text=text, lasting=False)


class Messages:
    """A reader of these messages."""

    def __init__(self, *messages: Parcel) -> None:
        self._left: Iterator[Parcel] = iter(messages)

    def next(self) -> Parcel:
        return next(self._left)


MEANS = [(START, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0)]
EVENT = Event(START, EventKind.DEVICE, "camera", "a fault", "error")


@pytest.mark.parametrize(
    ("message", "drawn"),
    [
        (rows_message(Kind.MEANS, MEANS), [("means", (MEANS,))]),
        (rows_message(Kind.LOADS, [(START, 5.0)]), [("loads", ([(START, 5.0)],))]),
        (rows_message(Kind.POINTS, [(1e-3, 5.0)]), [("points", ([(1e-3, 5.0)],))]),
        (rows_message(Kind.GAUGE, [(START, 1e-3, 1e-5)], "axial"), [("gauge", ("axial", [(START, 1e-3, 1e-5)]))]),
        (events_message([EVENT, EVENT]), [("events", ([EVENT, EVENT],))]),
        (Parcel(Kind.STATUS, {"markdown": "**well**"}), [("status", ("**well**",))]),
    ],
)  # fmt: skip
def test_a_message_is_drawn(message: Parcel, drawn: list[Any]) -> None:
    scene = Scene()
    process.SHOW[message.kind](scene, message)  # type: ignore[arg-type]
    assert scene.told == drawn


def test_pictures_fields_and_figures_are_drawn() -> None:
    scene, frame, m = Scene(), make_frame(0, START + 1.0), make_measurement(2)
    for message in (
        picture_message(frame),
        field_message(m.t, m.field),
        figures_message(Snapshot(START, "REC", valid=3, zois=4, figures=live_figures(force=7.0))),
    ):
        process.SHOW[message.kind](scene, message)  # type: ignore[arg-type]
    (_, (picture,)), (_, (t, field)), (_, (figures,)) = scene.told
    assert [name for name, _ in scene.told] == ["picture", "field", "figures"]
    assert isinstance(picture, PictureMessage) and (picture.t, picture.bits) == (START + 1.0, 12)
    assert t == m.t and np.array_equal(field.eyy, m.field.eyy, equal_nan=True)
    assert (figures.line, figures.cells[2][1]) == ("3 of 4 ZOIs, 1 LOST", "7.0")


def test_it_draws_until_the_end_and_says_so() -> None:
    scene, channel = Scene(), Channel()
    reader = Messages(Parcel(Kind.STATUS, {"markdown": "a"}), Parcel(Kind.END), Parcel(Kind.STATUS))
    process._draw(reader, scene, channel, 1e9)  # type: ignore[arg-type]
    assert [name for name, _ in scene.told] == ["begin", "status", "end", "end"]
    assert channel.sent == [(Kind.ENDED, {})]


@pytest.mark.parametrize(("grown", "full"), [(640.4, False), (641.6, True)])
def test_it_ends_where_it_has_grown_too_large(
    monkeypatch: pytest.MonkeyPatch, grown: float, full: bool
) -> None:
    """It looks every two seconds."""
    times = iter((0.0, 1.9, 2.1, 2.1, 2.2))
    monkeypatch.setattr(process.time, "monotonic", lambda: next(times))
    monkeypatch.setattr(process, "memory_MiB", lambda: grown)
    scene, channel = Scene(), Channel()
    reader = Messages(*[Parcel(Kind.STATUS, {"markdown": ""})] * 3, Parcel(Kind.END))
    process._draw(reader, scene, channel, 641.0)  # type: ignore[arg-type]
    assert channel.sent == ([(Kind.FULL, {"memory_MiB": 642})] if full else [(Kind.ENDED, {})])
    assert len([name for name, _ in scene.told if name == "status"]) == (2 if full else 3)
    assert scene.told[-1][0] == "end", "the file is closed"


@pytest.mark.parametrize(
    ("port", "rrd", "fails", "sinks", "trouble", "lasting"),
    [
        (9876, "v.rrd", {}, ["server", "file"], "", False),
        (None, "v.rrd", {}, ["file"], "", False),
        (9876, "v.rrd", {"serve": OSError("no port")}, ["file"],
         "the view's server did not start: no port; all else goes on", False),
        (9876, "v.rrd", {"write": FileExistsError()}, ["server"],
         "the view's file did not start: v.rrd exists already", False),
        (None, "v.rrd", {"write": OSError("full")}, [], "the view's file did not start: full; all else goes on", True),
        (None, None, {}, [], "the view has nowhere to draw to", True),
    ],
)  # fmt: skip
def test_what_is_served_and_written_is_told_and_so_is_what_does_not_start(
    monkeypatch: pytest.MonkeyPatch, port: int | None, rrd: str | None, fails: dict[str, Exception],
    sinks: list[str], trouble: str, lasting: bool,
) -> None:  # fmt: skip
    """Where nothing starts a restart is useless: the trouble is a lasting one."""

    def made(name: str, result: Any) -> Any:
        if name in fails:
            raise fails[name]
        return result

    monkeypatch.setattr(process, "serve", lambda *_: made("serve", ("server", 9877)))
    monkeypatch.setattr(process, "write", lambda *_: made("write", "file"))
    channel = Channel()
    assert process._open(SETUP, ViewTarget(port, rrd, "id"), channel) == sinks  # type: ignore[arg-type]
    told = [(meta["text"], meta["lasting"]) for kind, meta in channel.sent if kind is Kind.TROUBLE]
    assert [(text.startswith(trouble), last) for text, last in told] == ([(True, lasting)] if trouble else [])
    served = [meta for kind, meta in channel.sent if kind is Kind.SERVING]
    there = {"port": 9877 if "server" in sinks else None, "rrd": rrd if "file" in sinks else None}
    assert served == ([there] if sinks else [])


@pytest.mark.parametrize(
    ("sinks", "error", "code", "told"),
    [
        (["a sink"], None, 0, []),
        ([], None, 3, []),
        (["a sink"], EOFError(), 1, []),
        (["a sink"], ValueError("x"), 1, ["the view's process stopped by a defect: ValueError('x')"]),
    ],
)
def test_the_exit_code_of_the_process(
    monkeypatch: pytest.MonkeyPatch, sinks: list[Any], error: Exception | None, code: int, told: list[str]
) -> None:
    ours, theirs = socket.socketpair()
    drawn: list[float] = []

    def draw(reader: Any, scene: Any, channel: Any, limit: float) -> None:
        drawn.append(limit)
        if error is not None:
            raise error

    setup = setup_message(replace(SETUP, finished=True), ViewTarget(None, "v.rrd", "id"))
    there = MessagePipe(theirs)
    there.send(setup)
    for name, made in (("inherited_socket", lambda: ours), ("end_with", lambda parent: None), ("_draw", draw),
                       ("lowest_priority", lambda: None), ("_open", lambda *_: sinks)):  # fmt: skip
        monkeypatch.setattr(process, name, made)
    assert process.main() == code
    assert drawn == ([640 + 768] if sinks else [])
    if told:
        assert [from_json(there.next().meta["text"])] == told
    for one in (ours, theirs, there):
        one.close()


def test_answers_arrive_and_a_test_that_has_ended_is_ignored() -> None:
    ours, theirs = socket.socketpair()
    here, there = MessagePipe(ours), MessagePipe(theirs)
    channel = process.ReplyChannel(here)
    channel.notify(Message("{n} words", 2))
    answer = there.next()
    text = {"say": "{n} words", "with": {"n": 2}}
    assert (answer.kind, dict(answer.meta)) == (Kind.TROUBLE, {"text": text, "lasting": False})
    theirs.close()
    there.close()
    for _ in range(3):
        channel.notify("nobody hears it")
    ours.close()
    here.close()


def test_a_sink_takes_each_kind_at_its_rate() -> None:
    sink = RerunSink(None, Rates(2.0, 4.0, 0.5, limit_bytes=100))
    taken = {
        kind: sum(sink.takes(kind, k / 100) for k in range(1000))
        for kind in ("picture", "map", "more", "figures", "rows")
    }
    assert taken == {"picture": 20, "map": 40, "more": 10, "figures": 25, "rows": 5}
    sink.count(b"x" * 99)
    assert sink.takes("map", 20.0)
    sink.count(b"x")
    assert not sink.takes("map", 30.0) and not sink.takes("picture", 30.0)
    assert sink.takes("rows", 30.0) and sink.takes("figures", 30.0)


def test_curves_are_sent_again_each_time_so_much_was_drawn() -> None:
    drawn: list[int] = []
    sink, found = RerunSink(None, Rates(1.0, 1.0, repeat_bytes=100), SimpleNamespace(drawn=drawn.append)), []
    for _ in range(7):
        sink.count(b"x" * 40)
        found.append(sink.needs_curves_again())
    assert drawn == [40, 80, 120, 160, 200, 240, 280]
    assert found == [False, False, True, False, False, True, False]


class Proxy:
    """The proxy of the viewers, without sockets."""

    port, opened = 9877, ("", 0)

    def __init__(self, port: int, notify: Any) -> None:
        self.wanted = port

    def open(self, host: str, port: int) -> None:
        Proxy.opened = (host, port)

    def drawn(self, count: int) -> None: ...


@pytest.mark.parametrize(
    ("more", "memory", "rates"),
    [
        ({}, 64, Rates(5.0, 10.0, repeat_bytes=2**24)),
        ({"light": True, "picture_hz": 3.0}, 64, Rates(3.0, 1.0, repeat_bytes=2**24)),
        ({"finished": True}, 768, ALL),
    ],
)
def test_what_the_server_keeps_and_gets(
    monkeypatch: pytest.MonkeyPatch, more: dict[str, Any], memory: int, rates: Rates
) -> None:
    rr = pytest.importorskip("rerun")
    monkeypatch.setattr("live.ui.rerun.drawing.sinks.ViewerProxy", Proxy)
    monkeypatch.setattr("live.ui.rerun.drawing.sinks.hidden_address", lambda: ("127.0.0.1", 1234))
    monkeypatch.setattr("live.ui.rerun.drawing.sinks.wait_for", lambda *_: None)
    monkeypatch.setattr("live.ui.rerun.drawing.sinks._sink", lambda *given: given)
    monkeypatch.setattr(rr, "GrpcServerSink", lambda *given, **kept: (given, kept))
    told: list[str] = []
    made, port = serve(replace(SETUP, **more), ViewTarget(9876, None, "id"), told.append)
    server, _, recording, found, _ = made  # type: ignore[misc]
    assert server == (("127.0.0.1", 1234), {"server_memory_limit": f"{memory}MiB"})
    assert (recording, found, port) == ("id", rates, 9877)
    assert told == ["port 9876 is taken; the view is on 9877"] and Proxy.opened == ("127.0.0.1", 1234)


def test_the_file_of_a_running_test_is_thinned_and_of_a_finished_one_whole(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr("live.ui.rerun.drawing.sinks._sink", lambda *given: given)
    target = ViewTarget(None, str(tmp_path / "v.rrd"), "id")
    _, _, recording, rates = write(SETUP, target)  # type: ignore[misc]
    assert recording == "id-file"
    assert (rates.picture_hz, rates.map_hz, rates.row_hz, rates.limit_bytes) == (1.0, 2.0, 0.1, 1e9)
    with pytest.raises(FileExistsError):
        write(SETUP, target)
    whole = replace(target, rrd=str(tmp_path / "w.rrd"))
    assert write(replace(SETUP, finished=True), whole)[3] is ALL  # type: ignore[index]
