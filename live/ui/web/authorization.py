"""Authorization: the headers of every request are checked before anything is done.

A page of another site can make a browser send requests to 127.0.0.1, and can rebind its own name to that
address. So a request needs the token, in a cookie that requests of other sites do not carry, this address as
its ``Host``, and this page as its ``Origin`` where it changes something.
"""

from __future__ import annotations

import hmac
from dataclasses import dataclass
from email.message import Message
from http.cookies import CookieError, SimpleCookie

MAX_POST_BYTES = 1_000_000
"""Limit of a POST body."""


class HttpError(Exception):
    """A request that is refused.

    Parameters
    ----------
    status : int
        HTTP status.
    reason : str
        For a person.
    """

    def __init__(self, status: int, reason: str) -> None:
        super().__init__(reason)
        self.status, self.reason = status, reason


@dataclass(frozen=True, slots=True)
class RequestCheck:
    """Checks requests to ``http://127.0.0.1:port``.

    Attributes
    ----------
    port : int
    token : str
        The secret of this page: in the printed address, then in a cookie.
    """

    port: int
    token: str

    @property
    def host(self) -> str:
        """The only ``Host`` that is answered."""
        return f"127.0.0.1:{self.port}"

    @property
    def origin(self) -> str:
        """The only ``Origin`` that may change something."""
        return f"http://{self.host}"

    @property
    def address(self) -> str:
        """The address that a person opens."""
        return f"{self.origin}/?token={self.token}"

    @property
    def cookie(self) -> str:
        """The cookie with the token; its name contains the port, since cookies are shared by all ports of a host."""
        return f"{self._cookie_name}={self.token}; HttpOnly; SameSite=Strict; Path=/"

    @property
    def _cookie_name(self) -> str:
        return f"phasedic_{self.port}"

    def is_token(self, text: str) -> bool:
        """Whether ``text`` is the token."""
        return hmac.compare_digest(text.encode(), self.token.encode())

    def check_host(self, headers: Message) -> None:
        """Raise ``HttpError`` unless the request is for this address."""
        if headers.get("Host", "") != self.host:
            raise HttpError(403, "this is not the address of the page")

    def check_cookie(self, headers: Message) -> None:
        """Raise ``HttpError`` unless the cookie contains the token and no page of another site sends the request."""
        if headers.get("Sec-Fetch-Site", "same-origin") not in ("same-origin", "none"):
            raise HttpError(403, "requested by a page of another site")
        try:
            morsel = SimpleCookie(headers.get("Cookie", "")).get(self._cookie_name)
        except CookieError:
            morsel = None
        if morsel is None or not self.is_token(morsel.value):
            raise HttpError(403, "open the address that phasedic has printed, with its token")

    def check_post(self, headers: Message) -> int:
        """The length of the body; raise ``HttpError`` unless it is JSON from this page and not too long."""
        if headers.get("Origin", "") != self.origin:
            raise HttpError(403, "posted by another page")
        if headers.get("Content-Type", "").partition(";")[0].strip().lower() != "application/json":
            raise HttpError(403, "only JSON is accepted")
        length = headers.get("Content-Length", "")
        if not (length.isascii() and length.isdigit()) or "Transfer-Encoding" in headers:
            raise HttpError(411, "the length is missing")
        if len(length) > 12 or int(length) > MAX_POST_BYTES:
            raise HttpError(413, f"more than {MAX_POST_BYTES} bytes")
        return int(length)
