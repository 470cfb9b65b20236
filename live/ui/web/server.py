"""The HTTP server of the page: the one of the standard library, on 127.0.0.1 alone, a thread for each request.

A page sends few requests; the messages to it are server-sent events (``broadcaster``). ``access`` checks every
request before anything is done. Every response has a policy that limits what the browser may do with it.
"""

from __future__ import annotations

import contextlib
import io
import json
import logging
import secrets
import socket
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib.resources import files
from typing import Any
from urllib.parse import parse_qs, urlsplit

from acquire.errors import DeviceError
from acquire.system import lower_priority
from live.config.listen_address import listening_socket
from live.pipeline.latency import OUTPUT
from live.ui.web.authorization import HttpError, RequestCheck
from live.ui.web.broadcaster import Broadcaster, json_bytes
from live.ui.web.setup.config_draft import kinds_of_devices
from live.words.language import LANGUAGES, entries

log = logging.getLogger(__name__)

HOST = "127.0.0.1"
DEFAULT_PORT, TRIES = 8765, 10
HEARTBEAT_S = 0.5
"""Between heartbeats; the page shows NO LINK after 2 s without one."""

_SEND_BYTES = 2**14  # buffer for a page that does not read; more data would be old when it reads again
_TIMEOUT_S = 10.0  # a page that reads nothing for so long is disconnected
MAX_CONNECTIONS = 64
"""At one time; a browser opens six for each page."""
REQUEST_S = 10.0
"""For a whole request, headers and body, from the end of the one before on the same connection."""

PAGE_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; connect-src 'self';"
    " base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
"""What the page may load: only from this server."""
REPORT_POLICY = (
    "sandbox; default-src 'none'; style-src 'unsafe-inline'; img-src data:; base-uri 'none';"
    " form-action 'none'; frame-ancestors 'none'"
)
"""A report may only show itself."""

Query = Mapping[str, str]
Get = Callable[[Query], "Response"]
Post = Callable[[Mapping[str, Any]], Any]

_TYPES = {
    "html": "text/html; charset=utf-8",
    "js": "text/javascript; charset=utf-8",
    "json": "application/json",
    "css": "text/css; charset=utf-8",
    "txt": "text/plain; charset=utf-8",
}


@dataclass(frozen=True, slots=True)
class Response:
    """Content and headers of a response.

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
    policy: str = PAGE_POLICY


def jpeg_response(content: bytes) -> Response:
    """A JPEG picture."""
    return Response(content, "image/jpeg")


def json_response(value: Any) -> Response:
    """Values as JSON."""
    return Response(json_bytes(value))


def _file(path: str) -> Response:
    """A file of the page, the entries of a language, or the settings of cameras; raises ``HttpError``."""
    if path == "/settings.json":
        return json_response(kinds_of_devices())
    if path in (f"/words/{language}.json" for language in LANGUAGES):
        return json_response(entries(path[7:9]))
    return static("index.html" if path == "/" else path.removeprefix("/static/"))


def static_names() -> frozenset[str]:
    """The files of the page."""
    return frozenset(
        item.name for item in files("live.ui.web").joinpath("static").iterdir() if item.is_file()
    )


def static(name: str) -> Response:
    """A file of the page; raises ``HttpError`` for a name that is not in the folder (so also for a path)."""
    kind = _TYPES.get(name.rpartition(".")[2])
    if kind is None or name not in static_names():
        raise HttpError(404, "not found")
    return Response(files("live.ui.web").joinpath("static", name).read_bytes(), kind)


class PageServer:
    """Serves until it is closed.

    Parameters
    ----------
    broadcaster : Broadcaster
    gets, posts : mapping of path to callable
        Handlers beside the files of the page and the events.
    port : int
        Where it is taken, the next ones are tried; 0: any free port.

    Attributes
    ----------
    access : RequestCheck

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
        self.access = RequestCheck(self._server.server_address[1], secrets.token_urlsafe(24))
        self._server.page = self
        self._threads = [
            threading.Thread(target=self._server.serve_forever, args=(0.2,), name="page", daemon=True),
            threading.Thread(target=self._send_heartbeats, name="page-beat", daemon=True),
        ]
        for thread in self._threads:
            thread.start()

    @property
    def address(self) -> str:
        """The address that a person opens in a browser."""
        return self.access.address

    def close(self) -> None:
        """Disconnect all pages and release the port."""
        self._closed.set()
        self.broadcaster.close()
        self._server.shutdown()
        self._server.server_close()

    def _send_heartbeats(self) -> None:
        beats = 0
        while not self._closed.wait(HEARTBEAT_S):
            beats += 1
            self.broadcaster.publish("beat", beats)


class _Server(ThreadingHTTPServer):
    daemon_threads = True
    page: PageServer

    def __init__(self, *arguments: Any) -> None:
        self._free = threading.BoundedSemaphore(MAX_CONNECTIONS)
        super().__init__(*arguments)

    def process_request(self, request: Any, client_address: Any) -> None:
        """Serve a connection in a thread of its own, or close it where too many are open."""
        if self._free.acquire(blocking=False):
            super().process_request(request, client_address)
        else:
            self.shutdown_request(request)

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        """Serve a connection."""
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._free.release()

    def handle_error(self, request: Any, client_address: Any) -> None:
        """A connection that breaks is no fault of phasedic: nothing is printed."""
        log.debug("a connection to the page broke")

    def server_bind(self) -> None:
        """Bind the configured port or one of the next."""
        self.socket.close()
        self.socket = listening_socket(HOST, int(self.server_address[1]), TRIES)
        self.server_address = self.socket.getsockname()


def _open_server(port: int) -> _Server:
    try:
        return _Server((HOST, port), _Handler)
    except OSError as error:
        raise DeviceError(
            "the page: no port from {port} to {last} is free on {host} ({why}); end the programs that use them",
            port,
            port + TRIES - 1,
            HOST,
            error,
        ) from None


class _TimedStream(io.RawIOBase):
    """What a connection sends, up to a time for the whole request: one that sends a letter a second is cut off."""

    def __init__(self, connection: socket.socket) -> None:
        self._connection, self.end = connection, 0.0

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int:
        left = self.end - time.monotonic()
        if left <= 0:
            raise TimeoutError("the request takes too long")
        self._connection.settimeout(left)
        try:
            return self._connection.recv_into(buffer)
        finally:
            self._connection.settimeout(_TIMEOUT_S)


class _Handler(BaseHTTPRequestHandler):
    """One request."""

    server: _Server
    protocol_version = "HTTP/1.1"
    server_version, sys_version = "phasedic", ""
    timeout = _TIMEOUT_S

    def setup(self) -> None:
        lower_priority(OUTPUT)
        super().setup()
        self._stream = _TimedStream(self.connection)
        self.rfile = io.BufferedReader(self._stream)

    def handle_one_request(self) -> None:
        """One request, within ``REQUEST_S``."""
        self._stream.end = time.monotonic() + REQUEST_S
        super().handle_one_request()

    def log_message(self, format: str, *args: Any) -> None:
        """Log nothing: an address with the token must not be in a log."""

    def do_GET(self) -> None:
        """Answer with a file of the page, the events, or a handler of ``gets``."""
        with self._checked():
            self._get()

    def do_POST(self) -> None:
        """Answer with a handler of ``posts``."""
        with self._checked():
            self._post()

    @contextlib.contextmanager
    def _checked(self) -> Iterator[None]:
        try:
            yield
        except HttpError as refused:
            self._refuse(refused.reason, refused.status)
        except (OSError, ValueError):  # the browser closed the connection, or does not send HTTP
            self.close_connection = True
        except Exception:
            log.exception("a request to the page failed")
            self._refuse("a defect; see the log", 500)

    def _refuse(self, reason: str, status: int) -> None:
        self.close_connection = True
        with contextlib.suppress(OSError):  # nobody may be there to read it
            self._send(Response(reason.encode(), "text/plain; charset=utf-8"), status)

    def _get(self) -> None:
        page, parts = self.server.page, urlsplit(self.path)
        page.access.check_host(self.headers)
        query = {key: values[-1] for key, values in parse_qs(parts.query).items()}
        if parts.path == "/" and "token" in query:
            self._log_in(query["token"])
            return
        page.access.check_cookie(self.headers)
        if parts.path == "/events":
            self._events(page.broadcaster)
        elif parts.path in page.gets:
            self._send(page.gets[parts.path](query))
        else:
            self._send(_file(parts.path))

    def _log_in(self, token: str) -> None:
        """Put the token into a cookie, and remove it from the address, where others could read it.

        A page of its own does so: to a redirection of the file that opened it, no browser sends the cookie.
        """
        access = self.server.page.access
        if not access.is_token(token):
            raise HttpError(403, "a wrong token; open the address that phasedic has printed")
        forward = b'<link rel="icon" href="data:,"><meta http-equiv="refresh" content="0; url=/">'
        self._send(Response(forward, _TYPES["html"]), cookie=access.cookie)

    def _post(self) -> None:
        page = self.server.page
        page.access.check_host(self.headers)
        length = page.access.check_post(self.headers)
        page.access.check_cookie(self.headers)
        handler = page.posts.get(urlsplit(self.path).path)
        if handler is None:
            raise HttpError(404, "not found")
        try:
            value = json.loads(self._body(length))
        except (ValueError, RecursionError):
            raise HttpError(400, "not JSON") from None
        if not isinstance(value, dict):
            raise HttpError(400, "an object is expected")
        self._send(json_response(handler(value)))

    def _body(self, length: int) -> bytes:
        try:
            body = self.rfile.read(length)
        except TimeoutError:
            body = b""
        if len(body) < length:
            raise HttpError(400, "the body is shorter than its length")
        return body

    def _events(self, broadcaster: Broadcaster) -> None:
        """Send events until the page is closed or the server ends."""
        subscriber = broadcaster.open()
        if subscriber is None:
            raise HttpError(503, "too many pages are open; close one")
        try:
            self.close_connection = True
            self.connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BYTES)
            self._head(200, "text/event-stream", PAGE_POLICY, None)
            while (messages := subscriber.take(HEARTBEAT_S)) is not None:
                for kind, message in messages.items():
                    self.wfile.write(b"event: %s\ndata: %s\n\n" % (kind.partition(" ")[0].encode(), message))
                self.wfile.flush()
        finally:
            broadcaster.remove(subscriber)

    def _send(self, response: Response, status: int = 200, cookie: str = "") -> None:
        self._head(status, response.kind, response.policy, len(response.content), cookie)
        self.wfile.write(response.content)

    def _head(self, status: int, kind: str, policy: str, length: int | None, cookie: str = "") -> None:
        self.send_response(status)
        if cookie:
            self.send_header("Set-Cookie", cookie)
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
