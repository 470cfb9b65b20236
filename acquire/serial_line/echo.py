"""What an RS-485 adapter sends back of each poll, taken out before any protocol sees it.

Two wires carry both directions, and many adapters hear themselves. An answer may also begin with the poll, or be equal
to it, where no adapter echoes: what was sent is an echo only where the bytes behind it make more sense without it.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Callable

from acquire.protocols.base import Parser
from acquire.text import Message

LIMIT = 1024  # bytes held
DOUBT = Message("if the adapter echoes, the values are wrong: let the poll end with a line end")


class Echo:
    """Takes the echo out of what follows each poll.

    Until it is known whether the adapter echoes, what begins like the poll is held until the answer behind it is
    whole, or silence comes. Known, it is taken out as it comes, in pieces or at once.

    Parameters
    ----------
    parser : Parser
        That of the line, at the place where it is; copies of it try what the bytes mean.
    report : callable taking level and text

    Attributes
    ----------
    known : bool
        The adapter echoes.
    """

    def __init__(self, parser: Parser, report: Callable[[str, str], None]) -> None:
        self._parser, self._report = parser, report
        self._sent = self._held = b""
        self._told: set[str] = set()
        self.known = False

    def sent(self, data: bytes) -> None:
        """A poll was sent, or a command among polls."""
        self._sent += data

    def take(self, data: bytes) -> bytes:
        """What of the bytes that came, and of those held, goes on to the parser now."""
        self._held += data
        if not self._sent or len(self._held) > LIMIT:
            return self.release()
        if not (self._held.startswith(self._sent) or self._sent.startswith(self._held)):
            self.known = False
            return self.release()
        rest = self._held[len(self._sent) :]
        if len(self._held) < len(self._sent) or not (self.known or self._decided(rest)):
            return b""
        whole = self.release()
        return rest if self.known else whole

    def release(self) -> bytes:
        """What is held: it is no echo."""
        held, self._held, self._sent = self._held, b"", b""
        return held

    def _decided(self, rest: bytes) -> bool:
        """Whether the answer is whole, with the echo or without."""
        raw, bare = self._values(self._held), self._values(rest)
        self.known = any(bare) and not (all(raw) and len(raw) == len(bare))
        if self.known:
            self._tell(
                "info", Message("the adapter sends back what is sent to it (an echo): it is taken out")
            )
        elif any(bare):
            self._tell(
                "warning",
                Message(
                    "answers begin with the poll itself, {sent}, and are taken whole: {DOUBT}",
                    repr(self._sent),
                    DOUBT,
                ),
            )
        return any(bare) or (bool(bare) and all(raw))

    def _tell(self, level: str, text: str) -> None:
        if text not in self._told:
            self._told.add(text)
            self._report(level, text)

    def _values(self, data: bytes) -> list[bool]:
        """Whether each reading in the bytes is a value."""
        parser = copy.deepcopy(self._parser)
        return [not math.isnan(reading.value) for reading in (*parser.feed(data), *parser.silence())]
