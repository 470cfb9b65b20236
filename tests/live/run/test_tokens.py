"""A token is admitted as a whole or not at all: of the page, and of the ports."""

from __future__ import annotations

import socket
from email.message import Message

import pytest

from live.run.tcp_lines import Client
from live.ui.web.authorization import HttpError, RequestCheck

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
