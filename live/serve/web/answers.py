"""What a request is answered with: pages and pictures of ours, each with what a browser may do with it."""

from __future__ import annotations

from dataclasses import dataclass
from importlib.resources import files
from typing import Any

from live.serve.web.door import Refused
from live.serve.web.hub import encoded

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
class Answer:
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


def jpeg(content: bytes) -> Answer:
    """A picture."""
    return Answer(content, "image/jpeg")


def of_json(value: Any) -> Answer:
    """Plain values."""
    return Answer(encoded(value))


def static_names() -> frozenset[str]:
    """The files of the page."""
    return frozenset(item.name for item in files("live.serve").joinpath("static").iterdir() if item.is_file())


def static(name: str) -> Answer:
    """A file of the page; a name that is not in the list (so no path either) is ``Refused``."""
    kind = _TYPES.get(name.rpartition(".")[2])
    if kind is None or name not in static_names():
        raise Refused(404, "there is no such thing")
    return Answer(files("live.serve").joinpath("static", name).read_bytes(), kind)
