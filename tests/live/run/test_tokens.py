"""Commands: a token is admitted as a whole or not at all, and limits in time and letters."""

from __future__ import annotations

import socket
from email.message import Message
from typing import Any

import pytest

from acquire.events import Event, EventKind
from live.run.control import QUEUED, TareControl, answer
from live.run.tcp_lines import Client
from live.ui.web.authorization import HttpError, RequestCheck
from tests.live.run.test_control import FakeCell, FakeLive, TareSetup

TOKEN = "a-secret-word-of-some-length"
WRONG = ("", "a", TOKEN[:-1], TOKEN + "a", TOKEN.upper(), TOKEN[1:], "b" + TOKEN[1:], f"{TOKEN} {TOKEN}")
GUARD = RequestCheck(8080, TOKEN)


def headers(**given: str) -> Message:
    message = Message()
    for name, value in given.items():
        message[name.replace("_", "-")] = value
    return message


def test_the_token_of_a_page() -> None:
    assert GUARD.is_token(TOKEN)
    assert not any(map(GUARD.is_token, WRONG))


@pytest.mark.parametrize("word", WRONG[1:-1])
def test_the_cookie_of_a_page(word: str) -> None:
    GUARD.check_cookie(headers(Cookie=f"phasedic_8080={TOKEN}"))
    with pytest.raises(HttpError) as refused:
        GUARD.check_cookie(headers(Cookie=f"phasedic_8080={word}"))
    assert refused.value.status == 403
    with pytest.raises(HttpError):
        GUARD.check_cookie(headers(Cookie=f"phasedic_8081={TOKEN}"))


@pytest.mark.parametrize(
    "host", ["127.0.0.1", "127.0.0.1:80", "localhost:8080", "127.0.0.1:8080.example.org", ""]
)
def test_only_this_host(host: str) -> None:
    GUARD.check_host(headers(Host="127.0.0.1:8080"))
    with pytest.raises(HttpError):
        GUARD.check_host(headers(Host=host))


@pytest.mark.parametrize("site", ["cross-site", "same-site", ""])
def test_only_this_site(site: str) -> None:
    cookie = f"phasedic_8080={TOKEN}"
    GUARD.check_cookie(headers(Cookie=cookie, Sec_Fetch_Site="same-origin"))
    with pytest.raises(HttpError):
        GUARD.check_cookie(headers(Cookie=cookie, Sec_Fetch_Site=site))


@pytest.mark.parametrize("length", ["1000001", "9" * 13, "-1", "1e3", ""])
def test_the_length_of_what_is_posted(length: str) -> None:
    kind = {"Origin": "http://127.0.0.1:8080", "Content_Type": "application/json"}
    assert GUARD.check_post(headers(**kind, Content_Length="1000000")) == 1_000_000
    with pytest.raises(HttpError):
        GUARD.check_post(headers(**kind, Content_Length=length))


def test_the_token_of_a_port() -> None:
    here, there = connected()
    with there:
        client = Client(here, "a client", TOKEN)
        for word in WRONG:
            assert not client.authorize(f"token {word}") and not client.authorized
        assert client.authorize(f"token {TOKEN}") and client.authorized
        assert client.authorize(TOKEN)
        client.close()


def connected() -> tuple[socket.socket, socket.socket]:
    """Two ends of a TCP connection."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        there = socket.create_connection(server.getsockname())
        here, _ = server.accept()
    return here, there


@pytest.mark.parametrize(("letters", "good"), [(500, True), (501, False)])
def test_a_command_has_up_to_500_letters(letters: int, good: bool) -> None:
    live = FakeLive()
    said = answer("note ".ljust(letters, "x"), live)
    assert (said == "ok") is good and len(live.calls) == good
    assert good or said == "no: a command has up to 500 letters"


@pytest.mark.parametrize(("after_s", "done"), [(0.4, False), (0.5, True), (3.0, True), (3.1, False)])
def test_a_tare_is_confirmed_from_half_a_second_to_three_seconds_later(after_s: float, done: bool) -> None:
    bench = TareSetup()
    assert bench.refused().endswith("repeat the command within 3 s to do it")
    bench.now = 10.0 + after_s
    if done:
        assert bench.controls.tare() == QUEUED
    else:
        bench.refused()
    assert bench.cell.calls == ["tare"] * done


@pytest.mark.parametrize(("force", "at_once"), [(1.0, True), (-1.0, True), (1.01, False), (-1.01, False)])
def test_a_thousandth_of_the_capacity_is_no_load(force: float, at_once: bool) -> None:
    bench = TareSetup(force, capacity_N=1000.0)
    if at_once:
        bench.controls.tare()
    else:
        assert f"{force:g} N in mid-test" in bench.refused()
    assert bench.cell.calls == ["tare"] * at_once


def test_an_answer_to_a_tare_waits_two_seconds() -> None:
    nothing: Any = None
    assert TareControl(FakeCell(None), nothing, nothing, nothing, nothing)._wait_s == 2.0


def test_before_the_first_sample_a_tare_risks_nothing() -> None:
    cell = FakeCell(None)
    TareControl(cell, lambda: True, lambda: None, lambda *_: None, lambda: 0.0, wait_s=0).tare()
    assert cell.calls == ["tare"]


def test_an_answer_of_another_cell_is_none_of_this_one() -> None:
    bench = TareSetup(measured=False)
    bench.cell.says = [Event(10.0, EventKind.TARE, "/dev/y", "tared: 8 N", "info", {})]
    assert bench.controls.tare() == QUEUED
    bench.cell.says = [Event(10.0, EventKind.DEVICE, "/dev/x", "it did", "info", {"tared": True})]
    assert bench.controls.tare() == QUEUED


def test_a_forced_tare_is_told_as_one() -> None:
    bench = TareSetup()
    bench.controls.tare("force")
    bench.controls.tare("undo")
    assert [(kind, level, text) for kind, level, text in bench.told] == [
        (EventKind.TARE, "info", "tare, forced"), (EventKind.TARE, "info", "undo the last tare"),
    ]  # fmt: skip
    free = TareSetup(0.0)
    free.controls.tare()
    assert free.told == [(EventKind.TARE, "info", "tare")]
