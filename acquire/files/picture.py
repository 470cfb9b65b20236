"""Picture files as grey arrays and back; only regular files, decoded from memory.

A pipe, device or socket would wait or run for ever and is refused unopened. OpenCV crashes on a name that is not
UTF-8, so it gets bytes and no names. It fills what it cannot decode of an 8-bit TIFF or a JPEG with black or grey,
reports that on standard error and returns the picture. This report is caught: while a picture is decoded,
standard error leads into a file, and what others wrote meanwhile is passed on. Colour pictures of equal channels are
grey already; of others the grey has to be chosen.
"""

from __future__ import annotations

import atexit
import logging
import os
import re
import stat
import sys
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from acquire.cv2_loader import LOG_WARNING, load_cv2, log_settings
from acquire.errors import ConfigError, DataError
from acquire.files.headers import UNREADABLE, tiff_pages
from acquire.text import Message

MAX_BYTES = 2**31 - 1
_KINDS = {
    stat.S_IFIFO: "a pipe", stat.S_IFSOCK: "a socket", stat.S_IFDIR: "a folder",
    stat.S_IFCHR: "a device", stat.S_IFBLK: "a device",
}  # fmt: skip

GRAYS = ("luma", "r", "g", "b")
_PLANE = {"b": 0, "g": 1, "r": 2}  # OpenCV's order

WEBCAM_WARNING = Message(
    "grey is the luma of a compressed colour stream: clipped, with noise that averaging does not "
    "remove; a raw grey format measures better"
)

_DECODERS = re.compile(r"grfmt_\w+\.cpp|loadsave\.cpp|bitstrm\.cpp|^libpng |JPEG")
_DAMAGE = re.compile(r"TIFF_Error|can't read data|Decode: |Corrupt JPEG|Premature end|libpng error")
_TOO_LARGE = re.compile(r"MAX_IMAGE_|Insufficient memory")
_BEFORE = re.compile(r"^.*(TIFF_Error|TIFF_Warning|can't read data:) ?")
_lock = threading.Lock()
Source = bytes | str

_EXPORT = Message("cannot be read; save it as 16-bit TIFF pictures with the program of the camera")
FOREIGN = {
    **dict.fromkeys((".mraw", ".cih", ".cihx"), Message("a film of a Photron camera {EXPORT}", _EXPORT)),
    ".cine": Message("a film of a Phantom camera {EXPORT}", _EXPORT),
    ".seq": Message("a film of StreamPix {EXPORT}", _EXPORT),
    **dict.fromkeys(
        (".dng", ".cr2", ".cr3", ".nef", ".arw", ".raf", ".orf", ".rw2"),
        Message(
            "a raw picture cannot be read; develop it as 16-bit TIFF, without sharpening and without noise "
            "reduction"
        ),
    ),
    ".heic": Message("this picture cannot be read; save it as PNG or TIFF"),
}
"""Endings of files that are not read, and what to do with them."""
log = logging.getLogger(__name__)
LOSSY = (".jpg", ".jpeg")


def check_regular(path: Path) -> int:
    """The size of a regular file, bytes.

    Raises
    ------
    DataError
        Missing, not to be looked at, or no regular file.
    """
    try:
        status = path.stat()
    except (OSError, ValueError) as error:
        raise DataError("{path}: cannot be read: {why}", path, _why(error)) from error
    if not stat.S_ISREG(status.st_mode):
        kind = _KINDS.get(stat.S_IFMT(status.st_mode), "no file")
        raise DataError("{path}: cannot be read: it is {kind}; give a regular file", path, kind)
    return status.st_size


def read_bytes(path: Path, most: int = MAX_BYTES) -> bytes:
    """All of a regular file of at most ``most`` bytes.

    Raises
    ------
    DataError
        As ``check_regular``, larger, or unreadable.
    """
    size = check_regular(path)
    if size > most:
        raise DataError(
            "{path}: {size:.0f} MB are more than the {most:.0f} MB such a file may have",
            path,
            size / 1e6,
            most / 1e6,
        )
    try:
        # Whatever took the place of the file in the meantime does not make us wait.
        with os.fdopen(os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0)), "rb") as file:
            return file.read(size)
    except OSError as error:
        raise DataError("{path}: cannot be read: {why}", path, _why(error)) from error


def _why(error: Exception) -> str:
    return getattr(error, "strerror", None) or str(error)


@dataclass(frozen=True, slots=True, eq=False)
class Decoded:
    """What came out.

    Attributes
    ----------
    picture : (H, W) or (H, W, C) array, or None
        None: it could not be decoded at all.
    damage : str
        What the decoder complained of; empty where all was well.
    too_large : bool
        Beyond the limit of ``load_cv2``, or the memory.
    """

    picture: NDArray[Any] | None
    damage: str
    too_large: bool = False


def decode(source: Source, page: int = 0) -> Decoded:
    """Decode a picture, or one page of a multi-page TIFF, as it is: from its bytes, or from a file by name."""
    cv2, reports = load_cv2(), list[str]()
    picture: NDArray[Any] | None = None
    with _lock, _captured_reports(reports):
        try:
            picture = _decode(cv2, source, page)
        except cv2.error as error:
            reports.append(str(error))
    damage = next((line for line in reports if _DAMAGE.search(line)), "")
    too_large = picture is None and any(_TOO_LARGE.search(line) for line in reports)
    return Decoded(picture, _BEFORE.sub("", damage).strip()[:200], too_large)


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
def _captured_reports(lines: list[str]) -> Iterator[None]:
    """Fill ``lines`` with what the decoders report meanwhile."""
    if not _owns_stderr():
        yield
        return
    logging = log_settings(load_cv2())
    level, capture, error = logging.getLogLevel(), _capture_file(), os.dup(2)
    try:
        os.dup2(capture.fileno(), 2)
        logging.setLogLevel(LOG_WARNING)
        yield
    finally:
        logging.setLogLevel(level)
        os.dup2(error, 2)
        os.close(error)
        lines += _take_reports(capture)


def _owns_stderr() -> bool:
    """Whether descriptor 2 is standard error: of a process begun without one it may be a file of data."""
    try:
        return sys.__stderr__ is not None and sys.__stderr__.fileno() == 2 and os.fstat(2) is not None
    except (OSError, ValueError):
        return False


@cache
def _capture_file() -> IO[bytes]:
    capture: IO[bytes] = tempfile.TemporaryFile("w+b", buffering=0)  # noqa: SIM115 - as long as the program
    atexit.register(capture.close)
    return capture


def _take_reports(capture: IO[bytes]) -> list[str]:
    """The decoders' lines; those of others go to standard error."""
    size = os.fstat(capture.fileno()).st_size
    if not size:
        return []
    capture.seek(0)
    text = capture.read(size).decode("utf-8", "replace")
    capture.seek(0)
    capture.truncate()
    lines = text.splitlines()
    others = [line for line in lines if line.strip() and not _DECODERS.search(line)]
    if others:
        os.write(2, ("\n".join(others) + "\n").encode("utf-8", "replace"))
    return [line for line in lines if _DECODERS.search(line)]


def read_picture(path: Path) -> NDArray[Any]:
    """The picture in a file as it is, (H, W) or (H, W, C) of any type of sample.

    Raises
    ------
    DataError
        Missing, no regular file, no picture, or a damaged one.
    """
    return read_picture_page(path, picture_source(path))


def picture_source(path: Path) -> Source:
    """What to decode the pages of ``path`` from: its bytes; its name where it is too large for OpenCV's memory.

    Raises
    ------
    DataError
        Missing, no regular file, unreadable, or too large and its name is not UTF-8.
    """
    if check_regular(path) <= MAX_BYTES:
        return read_bytes(path)
    if not is_utf8(path):
        raise DataError(
            "{path}: a file of more than 2 GB is read by its name, which must be UTF-8; rename it", path
        )
    return str(path)


def is_utf8(path: Path) -> bool:
    """Whether a name may be given to OpenCV, which dies of others."""
    try:
        str(path).encode()
    except UnicodeEncodeError:
        return False
    return True


def read_picture_page(path: Path, source: Source, page: int = 0) -> NDArray[Any]:
    """A page of the picture file ``path``, out of its ``picture_source``; raises as ``read_picture``."""
    decoded = decode(source, page) if _complete(path, source) else None
    if decoded is None or decoded.picture is None:
        log.debug("%s: %s", path, decoded.damage if decoded else "ends too early")
        if decoded and decoded.too_large:
            raise DataError(
                "{path}: more than 268 million pixels, or than the memory holds; cut out the specimen, or bin it",
                path,
            )
        raise DataError("{path}: {why_not}", path, _why_not(path, page))
    if decoded.damage:
        raise DataError(
            "{path}: a damaged image ({damage}); copy it again or take it out of the list",
            path,
            decoded.damage,
        )
    return decoded.picture


def _why_not(path: Path, page: int) -> str:
    with suppress(DataError, IndexError):
        if packed := UNREADABLE.get(tiff_pages(path)[page].compression):
            return Message(
                "compressed with {packed}, which cannot be read; save it with LZW, Deflate or no compression",
                packed,
            )
    return Message("not an image, or cut off; copy it again or take it out of the list")


def _complete(path: Path, source: Source) -> bool:
    """A JPEG that was cut off is decoded without complaint: its end is looked at."""
    if isinstance(source, str) or path.suffix.lower() not in LOSSY:
        return True
    return source.rstrip(b"\0").endswith(b"\xff\xd9")


def write_picture(path: Path, picture: NDArray[Any]) -> None:
    """Write a new file in the format that its name ends in.

    Raises
    ------
    DataError
        It exists, cannot be written, or no format has that ending.
    """
    cv2 = load_cv2()
    try:
        well, content = cv2.imencode(path.suffix.lower(), picture)
    except cv2.error:
        well = False
    if not well:
        raise DataError(
            "{path}: no format of pictures has such an ending or samples; choose .png or .tif", path
        )
    try:
        with path.open("xb") as file:
            file.write(content.tobytes())
    except OSError as error:
        raise DataError(
            "{path}: cannot be written: {strerror}; look at the folder and the disk", path, error
        ) from error


def to_gray(picture: NDArray[Any], gray: str | None, source: str) -> NDArray[Any]:
    """The picture as one plane.

    Parameters
    ----------
    picture : (H, W) or (H, W, 1 | 3 | 4) uint8 | uint16
        Blue, green, red (and alpha, ignored), as OpenCV has them.
    gray : "luma" | "r" | "g" | "b" | None
        None: only a picture whose channels are equal is taken.
    source : str
        For messages.

    Raises
    ------
    ConfigError
        The channels differ and ``gray`` is not given.
    DataError
        Neither 8- nor 16-bit, or an unknown number of channels.
    """
    if picture.dtype not in (np.uint8, np.uint16):
        raise DataError(
            "{source}: samples are {dtype}; save it with 8 or 16 bits a sample", source, picture.dtype
        )
    if picture.ndim == 2:
        return picture
    if picture.ndim != 3 or picture.shape[2] not in (1, 3, 4):
        raise DataError(
            "{source}: a picture of shape {shape} is neither grey nor colour", source, picture.shape
        )
    if picture.shape[2] == 1:
        return picture[:, :, 0].copy()
    return _one_plane(picture, gray, source)


def _one_plane(picture: NDArray[Any], gray: str | None, source: str) -> NDArray[Any]:
    first = picture[:, :, 0]
    if all(np.array_equal(first, picture[:, :, k]) for k in (1, 2)):
        return first.copy()
    if gray is None:
        raise ConfigError(
            "{source}: a colour picture; add ?gray=luma (or r, g, b) to the address, as in 'shots?gray=luma'",
            source,
        )
    if gray in _PLANE:
        return picture[:, :, _PLANE[gray]].copy()
    cv2 = load_cv2()

    luma: NDArray[Any] = cv2.cvtColor(np.ascontiguousarray(picture[:, :, :3]), cv2.COLOR_BGR2GRAY)
    return luma
