"""Pictures out of bytes by OpenCV, with what its decoders complain of.

OpenCV fills what it cannot decode of an 8-bit TIFF or a JPEG with black or grey, says so on standard error
and returns the picture. That word is caught here: standard error leads into a file while a picture is
decoded, and what others wrote meanwhile is passed on.
"""

from __future__ import annotations

import os
import re
import sys
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from acquire.cv2_loader import load_cv2

_DECODERS = re.compile(r"grfmt_\w+\.cpp|loadsave\.cpp|bitstrm\.cpp|^libpng |JPEG")
_DAMAGE = re.compile(r"TIFF_Error|can't read data|Decode: |Corrupt JPEG|Premature end|libpng error")
_BEFORE = re.compile(r"^.*(TIFF_Error|TIFF_Warning|can't read data:) ?")
_lock = threading.Lock()
Source = bytes | str


@dataclass(frozen=True, slots=True, eq=False)
class Decoded:
    """What came out.

    Attributes
    ----------
    picture : (H, W) or (H, W, C) array, or None
        None: it could not be decoded at all.
    damage : str
        What the decoder complained of; empty where all was well.
    """

    picture: NDArray[Any] | None
    damage: str


def decode(source: Source, page: int = 0) -> Decoded:
    """Decode a picture, or one page of a multi-page TIFF, as it is: from its bytes, or from a file by name."""
    cv2, heard = load_cv2(), list[str]()
    picture: NDArray[Any] | None = None
    with _lock, _heard(heard):
        try:
            picture = _decode(cv2, source, page)
        except cv2.error as error:
            heard.append(str(error))
    damage = next((line for line in heard if _DAMAGE.search(line)), "")
    return Decoded(picture, _BEFORE.sub("", damage).strip()[:200])


def _decode(cv2: Any, source: Source, page: int) -> NDArray[Any] | None:
    if not source:
        return None
    as_is = cv2.IMREAD_UNCHANGED
    if isinstance(source, str):
        well, pages = cv2.imreadmulti(source, page, 1, flags=as_is)
    elif page:
        well, pages = cv2.imdecodemulti(np.frombuffer(source, np.uint8), as_is, range=(page, page + 1))
    else:
        one = cv2.imdecode(np.frombuffer(source, np.uint8), as_is)
        well, pages = one is not None, [one]
    return pages[0] if well and pages else None


@contextmanager
def _heard(lines: list[str]) -> Iterator[None]:
    """Fill ``lines`` with what the decoders say meanwhile."""
    if not _ours():
        yield
        return
    logging = load_cv2().utils.logging
    level, ear, error = logging.getLogLevel(), _ear(), os.dup(2)
    try:
        os.dup2(ear.fileno(), 2)
        logging.setLogLevel(logging.LOG_LEVEL_WARNING)
        yield
    finally:
        logging.setLogLevel(level)
        os.dup2(error, 2)
        os.close(error)
        lines += _taken(ear)


def _ours() -> bool:
    """Whether descriptor 2 is standard error: of a process begun without one it may be a file of data."""
    try:
        return sys.__stderr__ is not None and sys.__stderr__.fileno() == 2 and os.fstat(2) is not None
    except (OSError, ValueError):
        return False


@cache
def _ear() -> BinaryIO:
    return tempfile.TemporaryFile("w+b", buffering=0)


def _taken(ear: BinaryIO) -> list[str]:
    """The decoders' lines; those of others go to standard error."""
    size = os.fstat(ear.fileno()).st_size
    if not size:
        return []
    ear.seek(0)
    text = ear.read(size).decode("utf-8", "replace")
    ear.seek(0)
    ear.truncate()
    lines = text.splitlines()
    others = [line for line in lines if line.strip() and not _DECODERS.search(line)]
    if others:
        os.write(2, ("\n".join(others) + "\n").encode("utf-8", "replace"))
    return [line for line in lines if _DECODERS.search(line)]
