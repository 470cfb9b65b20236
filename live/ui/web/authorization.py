"""Who may come in: every request is judged by its headers before anything is done.

A page of another site can make a browser send requests to 127.0.0.1, and can rebind its own name to that
address; so a request needs the token as a cookie that no other site's request carries, our own address as
its ``Host``, and where it changes something our own ``Origin``.
"""

from __future__ import annotations

import hmac
from dataclasses import dataclass
from email.message import Message
from http.cookies import CookieError, SimpleCookie

MAX_POST_BYTES = 1_000_000
"""Of what is posted."""


class HttpError(Exception):
    """A request that is not answered.

    Parameters
    ----------
    status : int
        Of HTTP.
    why : str
        For a person.
    """

    def __init__(self, status: int, reason: str) -> None:
        super().__init__(reason)
        self.status, self.reason = status, reason


@dataclass(frozen=True, slots=True)
class RequestGuard:
    """Judges requests to ``http://127.0.0.1:port``.

    Attributes
    ----------
    port : int
    token : str
        The secret of this page; stands in the address that is printed, then in a cookie.
    """

    port: int
    token: str

    @property
    def host(self) -> str:
        """The one ``Host`` that is answered."""
        return f"127.0.0.1:{self.port}"

    @property
    def origin(self) -> str:
        """The one ``Origin`` that may change something."""
        return f"http://{self.host}"

    @property
    def address(self) -> str:
        """What a person opens."""
        return f"{self.origin}/?token={self.token}"

    @property
    def cookie(self) -> str:
        """The header that keeps the token in the browser; other ports of this machine have names of their own."""
        return f"{self._name}={self.token}; HttpOnly; SameSite=Strict; Path=/"

    @property
    def _name(self) -> str:
        return f"phasedic_{self.port}"

    def is_token(self, word: str) -> bool:
        """Whether ``word`` is the token."""
        return hmac.compare_digest(word.encode(), self.token.encode())

    def check_host(self, headers: Message) -> None:
        """Raise ``HttpError`` unless the request is for this address, and not sent by another site's page."""
        if headers.get("Host", "") != self.host:
            raise HttpError(403, "this is not the address of the page")
        if headers.get("Sec-Fetch-Site", "same-origin") not in ("same-origin", "none"):
            raise HttpError(403, "asked by a page of another site")

    def check_cookie(self, headers: Message) -> None:
        """Raise ``HttpError`` unless the cookie has the token."""
        try:
            morsel = SimpleCookie(headers.get("Cookie", "")).get(self._name)
        except CookieError:
            morsel = None
        if morsel is None or not self.is_token(morsel.value):
            raise HttpError(403, "open the address that phasedic has printed, with its token")

    def check_post(self, headers: Message) -> int:
        """The length of what is posted; raise ``HttpError`` unless it is our page's own JSON of a sensible length."""
        if headers.get("Origin", "") != self.origin:
            raise HttpError(403, "posted by another page than ours")
        if headers.get("Content-Type", "").partition(";")[0].strip().lower() != "application/json":
            raise HttpError(403, "nothing but JSON is taken")
        length = headers.get("Content-Length", "")
        if not (length.isascii() and length.isdigit()) or "Transfer-Encoding" in headers:
            raise HttpError(411, "say how long it is")
        if len(length) > 12 or int(length) > MAX_POST_BYTES:
            raise HttpError(413, f"more than {MAX_POST_BYTES} bytes")
        return int(length)
