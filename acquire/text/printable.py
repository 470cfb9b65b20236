"""Text for a terminal: words of others made harmless (a file or a device may give anything), times in words."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from numbers import Number

from acquire.text.message import Message
from acquire.text.quantity import Amount

# Control characters of both kinds (but for line feed and tab), halves of surrogate pairs, marks that turn the
# direction of writing or are not seen, and separators that some terminals take for an end of line.
_HARMFUL = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\u00ad\u061c\u200b-\u200f\u2028-\u202e\u2060-\u206f\ufeff\ufff9-\ufffb\ud800-\udfff]"
)


def printable(text: object) -> str:
    """``text`` with everything that could command a terminal written as an escape, ``\\x1b`` for one.

    Bytes of a file name that are no UTF-8 are shown as those bytes. A message stays one: its values are changed.
    """
    return changed(text, lambda words: _HARMFUL.sub(_escaped, words))


def changed(text: object, change: Callable[[str], str]) -> str:
    """What ``change`` makes of a text; of a message, of the values in it."""
    text = getattr(text, "text", text) if isinstance(text, Exception) else text
    if not isinstance(text, Message) or not text.values:
        words = change(str(text))
        return text if words == text else words
    values = {
        key: one if isinstance(one, Number | Amount) else changed(one, change)
        for key, one in text.values.items()
    }
    return Message(text.template, **values)


# A device or file by its address at the beginning of a sentence, with its settings; a path goes on after them.
_ADDRESS = re.compile(r"^([^\s?]+)\?[A-Za-z_]\w*=[^\s/]*(?=: |$)")


def brief(text: object) -> str:
    """A sentence that begins with an address, without the settings of that address."""
    return changed(text, lambda words: _ADDRESS.sub(r"\1", words))


def counted(n: int, noun: str) -> str:
    """As "1 frame" or "3 frames"."""
    return Message(f"{{n}} {noun}{'' if n == 1 else 's'}", Amount("count", n))


def duration(seconds: float) -> str:
    """As 1:23 or 1:02:03."""
    minutes, rest = divmod(max(0, round(seconds)), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{rest:02}" if hours else f"{minutes}:{rest:02}"


def _escaped(found: re.Match[str]) -> str:
    code = ord(found[0])
    if 0xDC80 <= code <= 0xDCFF:  # a byte that Python could not decode
        code -= 0xDC00
    return f"\\x{code:02x}" if code < 0x100 else f"\\u{code:04x}"


def share_text(share: float) -> str:
    """What marks a value whose area lost a block: "of 83 % of the area"; empty where it stands for all of it."""
    if share == 1:
        return ""
    return Message(
        "of {share} % of the area", min(math.floor(100 * share + 1e-4), 99)
    )  # float32 may be below
