"""The responses of the server of the page, and every refusal."""

from __future__ import annotations

import contextlib
import http.client
import socket
import struct
import threading
from collections.abc import Iterator, Mapping
from typing import Any

import pytest

from live.ui.web import server
from live.ui.web.broadcaster import MAX_PAGES, Broadcaster
from live.ui.web.server import PageServer, json_response
from tests.live.ui.waiting import LONG_S, until


@pytest.fixture
def page() -> Iterator[PageServer]:
    opened = PageServer(
        Broadcaster(),
        {"/picture": lambda query: json_response(dict(query))},
        {"/order": lambda value: {"got": value}},
        port=0,
    )
    yield opened
    opened.close()


class ReadResponse:
    """A response that was read."""

    def __init__(self, response: http.client.HTTPResponse) -> None:
        self.status, self.headers, self.body = response.status, response.headers, response.read()


def fetch(
    page: PageServer,
    path: str,
    headers: Mapping[str, str] | None = None,
    *,
    method: str = "GET",
    body: Any = None,
) -> ReadResponse:
    """A request as the page sends it, except for ``headers``; a header of "" is left out."""
    guard = page.access
    own = {"Host": guard.host, "Cookie": guard.cookie.partition(";")[0], "Sec-Fetch-Site": "same-origin"}
    if method == "POST":
        own |= {"Origin": guard.origin, "Content-Type": "application/json"}
    sent = {key: value for key, value in (own | dict(headers or {})).items() if value}
    connection = http.client.HTTPConnection("127.0.0.1", guard.port, timeout=LONG_S)
    try:
        connection.putrequest(method, path, skip_host=True)
        for key, value in sent.items():
            connection.putheader(key, value)
        if body is not None and "Content-Length" not in sent:
            connection.putheader("Content-Length", str(len(body)))
        connection.endheaders(body)
        return ReadResponse(connection.getresponse())
    finally:
        connection.close()


def test_only_this_machine_can_connect(page: PageServer) -> None:
    assert page.address.startswith("http://127.0.0.1:")
    others = {info[4][0] for info in socket.getaddrinfo(socket.gethostname(), None, socket.AF_INET)} - {
        "127.0.0.1"
    }
    for other in others:
        with pytest.raises(OSError), socket.create_connection((other, page.access.port), timeout=1):
            pass


def test_the_address_sets_the_cookie_and_hides_the_token(page: PageServer) -> None:
    """Also from the file that a browser opens, which is another site."""
    for site in ("none", "cross-site"):
        answer = fetch(page, f"/?token={page.access.token}", {"Cookie": "", "Sec-Fetch-Site": site})
        assert answer.status == 200 and b'content="0; url=/"' in answer.body
    cookie = answer.headers["Set-Cookie"]
    assert page.access.token in cookie and "HttpOnly" in cookie and "SameSite=Strict" in cookie


def test_a_response_forbids_other_sites(page: PageServer) -> None:
    answer = fetch(page, "/picture?a=1")
    assert answer.status == 200 and answer.body == b'{"a":"1"}'
    policy = answer.headers["Content-Security-Policy"]
    assert "default-src 'none'" in policy and "frame-ancestors 'none'" in policy and "unsafe" not in policy
    assert (
        "Access-Control-Allow-Origin" not in answer.headers
        and answer.headers["X-Content-Type-Options"] == "nosniff"
    )


def test_a_command_is_accepted(page: PageServer) -> None:
    assert fetch(page, "/order", method="POST", body=b'{"line":"tare"}').body == b'{"got":{"line":"tare"}}'


@pytest.mark.parametrize(
    ("status", "path", "headers"),
    [
        (403, "/?token=wrong", {"Cookie": ""}),
        (403, "/?token=", {"Cookie": ""}),
        (403, "/", {"Cookie": ""}),
        (403, "/", {"Cookie": "phasedic=x"}),
        (403, "/events", {"Cookie": ""}),
        (403, "/picture", {"Cookie": ""}),
        (403, "/", {"Host": "evil.example"}),
        (403, "/", {"Host": ""}),
        (403, "/?token={token}", {"Host": "evil.example:{port}"}),
        (403, "/", {"Host": "localhost:{port}"}),
        (403, "/", {"Sec-Fetch-Site": "cross-site"}),
        (403, "/?token=wrong", {"Sec-Fetch-Site": "cross-site"}),
        (403, "/picture", {"Sec-Fetch-Site": "same-site"}),
        (404, "/static/../server.py", {}),
        (404, "/static/..%2fserver.py", {}),
        (404, "/static//etc/passwd", {}),
        (404, "/../../etc/passwd", {}),
        (404, "/nothing", {}),
    ],
)
def test_refused_gets(page: PageServer, status: int, path: str, headers: dict[str, str]) -> None:
    known = {"token": page.access.token, "port": page.access.port}
    answer = fetch(page, path.format(**known), {key: value.format(**known) for key, value in headers.items()})
    assert answer.status == status
    assert page.access.token.encode() not in answer.body and page.access.token not in str(answer.headers)


@pytest.mark.parametrize(
    ("status", "headers", "body"),
    [
        (403, {"Origin": ""}, b"{}"),
        (403, {"Origin": "null"}, b"{}"),
        (403, {"Origin": "http://evil.example"}, b"{}"),
        (403, {"Origin": "http://localhost:{port}"}, b"{}"),
        (403, {"Origin": "http://127.0.0.1:1"}, b"{}"),
        (403, {"Host": "evil.example"}, b"{}"),
        (403, {"Cookie": ""}, b"{}"),
        (403, {"Sec-Fetch-Site": "cross-site"}, b"{}"),
        (403, {"Content-Type": "text/plain"}, b"{}"),
        (403, {"Content-Type": "application/x-www-form-urlencoded"}, b"{}"),
        (403, {"Content-Type": ""}, b"{}"),
        (413, {"Content-Length": "1000001"}, b""),
        (413, {"Content-Length": "9" * 300}, b""),
        (411, {"Content-Length": "-1"}, b""),
        (411, {"Transfer-Encoding": "chunked"}, b"0\r\n\r\n"),
        (400, {}, b"{"),
        (400, {}, b"[" * 100_000),
        (400, {}, b"[1]"),
    ],
)
def test_refused_posts(page: PageServer, status: int, headers: dict[str, str], body: bytes) -> None:
    asked = {key: value.format(port=page.access.port) for key, value in headers.items()}
    assert fetch(page, "/order", asked, method="POST", body=body).status == status


def test_no_preflight_is_answered(page: PageServer) -> None:
    asked = {"Origin": "http://evil.example", "Access-Control-Request-Method": "POST", "Cookie": ""}
    answer = fetch(page, "/order", asked, method="OPTIONS")
    assert answer.status >= 400
    assert not [name for name in answer.headers if name.lower().startswith("access-control")]


def stream(page: PageServer) -> http.client.HTTPResponse:
    connection = http.client.HTTPConnection("127.0.0.1", page.access.port, timeout=LONG_S)
    connection.request("GET", "/events", headers={"Cookie": page.access.cookie.partition(";")[0]})
    return connection.getresponse()


def test_a_ninth_page_is_refused_until_one_goes(page: PageServer) -> None:
    streams = [stream(page) for _ in range(MAX_PAGES)]
    assert {one.status for one in streams} == {200}
    assert fetch(page, "/events").status == 503
    streams[0].close()

    def gone() -> bool:
        page.broadcaster.publish("state", "x" * 10)  # the server notices a closed page when it writes to it
        return page.broadcaster.open_pages < MAX_PAGES

    until(gone)
    again = stream(page)
    assert again.status == 200
    for one in [*streams[1:], again]:
        one.close()


def test_a_page_gets_the_newest_message_first(page: PageServer) -> None:
    for number in range(3):
        page.broadcaster.publish("state", {"n": number, "nan": float("nan")})
    with stream(page) as events:
        assert events.fp.readline() == b"event: state\n"
        assert events.fp.readline() == b'data: {"n":2,"nan":null}\n'


def connected(page: PageServer, text: bytes) -> socket.socket:
    """A connection that has sent this."""
    opened = socket.create_connection(("127.0.0.1", page.access.port), timeout=LONG_S)
    opened.sendall(text)
    return opened


def post_head(page: PageServer, length: int) -> bytes:
    guard = page.access
    lines = [
        "POST /order HTTP/1.1",
        f"Host: {guard.host}",
        f"Origin: {guard.origin}",
        f"Content-Length: {length}",
    ]
    lines += ["Content-Type: application/json", f"Cookie: {guard.cookie.partition(';')[0]}", "", ""]
    return "\r\n".join(lines).encode()


def test_a_body_shorter_than_its_length_is_refused(page: PageServer) -> None:
    with connected(page, post_head(page, 50) + b'{"line":') as opened:
        opened.shutdown(socket.SHUT_WR)
        assert opened.recv(100).startswith(b"HTTP/1.1 400")


def test_a_request_that_takes_too_long_is_cut_off(page: PageServer, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server, "REQUEST_S", 0.1)
    with connected(page, b"GET / HTTP/1.1\r\nHost: ") as opened:
        assert opened.recv(100) == b"", "the head is not complete"
    with connected(page, post_head(page, 50) + b'{"line":') as opened:
        assert opened.recv(100).startswith(b"HTTP/1.1 400"), "the body is not complete"


def test_connections_are_limited(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server, "MAX_CONNECTIONS", 2)
    page = PageServer(Broadcaster(), {"/picture": lambda query: json_response({})}, {}, port=0)
    try:
        first, second = (connected(page, b"GET /picture HTTP/1.1\r\n") for _ in range(2))
        with connected(page, b"") as third:
            assert third.recv(100) == b"", "closed at once"
        first.close()

        def answered() -> bool:
            try:
                return fetch(page, "/picture").status == 200
            except (http.client.HTTPException, OSError):
                return False

        until(answered)
        second.close()
    finally:
        page.close()


def test_nothing_is_printed_whatever_comes(page: PageServer, capfd: pytest.CaptureFixture[str]) -> None:
    sent = [
        b"", b"\x00" * 500, b"GET\r\n\r\n", b"GET / HTTP/9.9\r\n\r\n", b"A" * 70_000, post_head(page, 900) + b"{",
        b"GET /picture HTTP/1.1\r\nHost: evil\r\n\r\n", b"POST /order HTTP/1.1\r\n\r\n", post_head(page, 2),
    ]  # fmt: skip
    for text in sent:
        opened = connected(page, b"")
        opened.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))  # reset, not closed
        with contextlib.suppress(OSError):
            opened.sendall(text)
        opened.close()
    assert fetch(page, "/picture").status == 200
    until(lambda: not [one for one in threading.enumerate() if "process_request" in one.name])
    assert capfd.readouterr() == ("", "")
