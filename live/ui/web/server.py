"""The page's server: the standard library's, on 127.0.0.1 alone, a thread for each request.

Requests of a page are few; what is told to it goes as server-sent events (``broadcaster``). ``guard`` judges every
request before anything is done.

What a request is answered with: pages and pictures of ours, each with what a browser may do with it.
"""

from __future__ import annotations

import json
import logging
import secrets
import socket
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib.resources import files
from typing import Any
from urllib.parse import parse_qs, urlsplit

from acquire.errors import DeviceError
from live.config.listen_address import listening
from live.pipeline.latency import OUTPUT, lower_priority
from live.ui.web.authorization import HttpError, RequestGuard
from live.ui.web.broadcaster import Broadcaster, encoded

OURS = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; connect-src 'self';"
    " base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
"""What our page may load: nothing but from here."""
ALONE = (
    "sandbox; default-src 'none'; style-src 'unsafe-inline'; img-src data:; base-uri 'none';"
    " form-action 'none'; frame-ancestors 'none'"
)
"""What a report may: show itself."""

_TYPES = {
    "html": "text/html; charset=utf-8",
    "js": "text/javascript; charset=utf-8",
    "css": "text/css; charset=utf-8",
    "txt": "text/plain; charset=utf-8",
}


@dataclass(frozen=True, slots=True)
class Response:
    """What is sent back.

    Attributes
    ----------
    content : bytes
    kind : str
        Media type.
    policy : str
        Content-Security-Policy.
    """

    content: bytes
    kind: str = "application/json"
    policy: str = OURS


def jpeg(content: bytes) -> Response:
    """A picture."""
    return Response(content, "image/jpeg")


def of_json(value: Any) -> Response:
    """Plain values."""
    return Response(encoded(value))


def static_names() -> frozenset[str]:
    """The files of the page."""
    return frozenset(
        item.name for item in files("live.ui.web").joinpath("static").iterdir() if item.is_file()
    )


def static(name: str) -> Response:
    """A file of the page; a name that is not in the list (so no path either) is ``HttpError``."""
    kind = _TYPES.get(name.rpartition(".")[2])
    if kind is None or name not in static_names():
        raise HttpError(404, "there is no such thing")
    return Response(files("live.ui.web").joinpath("static", name).read_bytes(), kind)


log = logging.getLogger(__name__)

HOST = "127.0.0.1"
DEFAULT_PORT, TRIES = 8765, 10
BEAT_S = 0.5
"""Between heartbeats; the page says NO LINK after 2 s without."""
_UNREAD_BYTES = 2**14  # held for a page that does not read; more would be old when it reads again
_SLOW_S = 10.0  # a page that does not take what is sent to it for so long has gone

Query = Mapping[str, str]
Get = Callable[[Query], Response]
Post = Callable[[Mapping[str, Any]], Any]


class PageServer:
    """Serves until it is closed.

    Parameters
    ----------
    broadcaster : Broadcaster
    gets, posts : mapping of path to callable
        What is answered beside the files of the page and the events.
    port : int
        The next ones are tried where it is taken; 0: any.

    Attributes
    ----------
    guard : RequestGuard

    Raises
    ------
    DeviceError
        No port is free.
    """

    def __init__(
        self,
        broadcaster: Broadcaster,
        gets: Mapping[str, Get],
        posts: Mapping[str, Post],
        port: int = DEFAULT_PORT,
    ) -> None:
        self.broadcaster, self.gets, self.posts = broadcaster, gets, posts
        self._closed = threading.Event()
        self._server = _open_server(port)
        self.guard = RequestGuard(self._server.server_address[1], secrets.token_urlsafe(24))
        self._server.page = self
        self._threads = [
            threading.Thread(target=self._server.serve_forever, args=(0.2,), name="page", daemon=True),
            threading.Thread(target=self._beat, name="page-beat", daemon=True),
        ]
        for thread in self._threads:
            thread.start()

    @property
    def address(self) -> str:
        """What a person opens in a browser."""
        return self.guard.address

    def close(self) -> None:
        """End all streams and give the port back."""
        self._closed.set()
        self.broadcaster.close()
        self._server.shutdown()
        self._server.server_close()

    def _beat(self) -> None:
        beats = 0
        while not self._closed.wait(BEAT_S):
            beats += 1
            self.broadcaster.tell("beat", beats)


class _Server(ThreadingHTTPServer):
    daemon_threads = True
    page: PageServer

    def server_bind(self) -> None:
        """At the port that is wanted or one of the next."""
        self.socket.close()
        self.socket = listening(HOST, int(self.server_address[1]), TRIES)
        self.server_address = self.socket.getsockname()


def _open_server(port: int) -> _Server:
    try:
        return _Server((HOST, port), _Handler)
    except OSError as error:
        raise DeviceError(
            f"the page: no port from {port} to {port + TRIES - 1} is free on {HOST} ({error}); end what holds them"
        ) from None


class _Handler(BaseHTTPRequestHandler):
    """One request."""

    server: _Server
    protocol_version = "HTTP/1.1"
    server_version, sys_version = "phasedic", ""
    timeout = _SLOW_S

    def setup(self) -> None:
        lower_priority(OUTPUT)
        super().setup()

    def log_message(self, format: str, *args: Any) -> None:
        """Requests are nobody's business; an address with the token must not be logged."""

    def do_GET(self) -> None:
        """A file of the page, the events, or what ``gets`` has."""
        self._guarded(self._get)

    def do_POST(self) -> None:
        """An order or a change."""
        self._guarded(self._post)

    def _guarded(self, step: Callable[[], None]) -> None:
        try:
            self.server.page.guard.check_place(self.headers)
            step()
        except HttpError as refused:
            self.close_connection = True
            self._send(Response(refused.why.encode(), "text/plain; charset=utf-8"), refused.status)
        except (OSError, ValueError):  # the browser has gone, or sends no HTTP
            self.close_connection = True
        except Exception:
            log.exception("a request to the page failed")
            self.close_connection = True
            self._send(Response(b"a defect; see the log", "text/plain; charset=utf-8"), 500)

    def _get(self) -> None:
        page, parts = self.server.page, urlsplit(self.path)
        query = {key: values[-1] for key, values in parse_qs(parts.query).items()}
        if parts.path == "/" and "token" in query:
            self._let_in(query["token"])
            return
        page.guard.check_cookie(self.headers)
        if parts.path == "/events":
            self._events(page.broadcaster)
        elif parts.path in page.gets:
            self._send(page.gets[parts.path](query))
        else:
            name = "index.html" if parts.path == "/" else parts.path.removeprefix("/static/")
            self._send(static(name))

    def _let_in(self, word: str) -> None:
        """Put the token into a cookie and take it out of the address, where it could be read or handed on."""
        guard = self.server.page.guard
        if not guard.is_key(word):
            raise HttpError(403, "a wrong token; open the address that phasedic has printed")
        self.send_response(303)
        self.send_header("Location", "/")
        self.send_header("Set-Cookie", guard.cookie)
        self.send_header("Content-Length", "0")
        self.end_headers()

    def _post(self) -> None:
        page = self.server.page
        length = page.guard.check_post(self.headers)
        page.guard.check_cookie(self.headers)
        handler = page.posts.get(urlsplit(self.path).path)
        if handler is None:
            raise HttpError(404, "there is no such thing")
        try:
            value = json.loads(self.rfile.read(length))
        except (ValueError, RecursionError):
            raise HttpError(400, "not JSON") from None
        if not isinstance(value, dict):
            raise HttpError(400, "an object is expected")
        self._send(of_json(handler(value)))

    def _events(self, broadcaster: Broadcaster) -> None:
        """Server-sent events until the page goes or all is over."""
        stream = broadcaster.open()
        if stream is None:
            raise HttpError(503, "too many pages are open; close one")
        try:
            self.close_connection = True
            self.connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _UNREAD_BYTES)
            self._head(200, "text/event-stream", OURS, None)
            while (messages := stream.take(BEAT_S)) is not None:
                for kind, message in messages.items():
                    self.wfile.write(b"event: %s\ndata: %s\n\n" % (kind.encode(), message))
                self.wfile.flush()
        finally:
            broadcaster.leave(stream)

    def _send(self, answer: Response, status: int = 200) -> None:
        self._head(status, answer.kind, answer.policy, len(answer.content))
        self.wfile.write(answer.content)

    def _head(self, status: int, kind: str, policy: str, length: int | None) -> None:
        self.send_response(status)
        self.send_header("Content-Type", kind)
        if length is not None:
            self.send_header("Content-Length", str(length))
        self.send_header("Content-Security-Policy", policy)
        self.send_header("Cache-Control", "no-store")
        self.send_header("X-Content-Type-Options", "nosniff")
        self.send_header("Referrer-Policy", "no-referrer")
        self.send_header("Cross-Origin-Resource-Policy", "same-origin")
        if self.close_connection:
            self.send_header("Connection", "close")
        self.end_headers()
