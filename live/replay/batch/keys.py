"""The key of a result: a hash of all it depends on (recording or pictures, settings, versions)."""

from __future__ import annotations

import contextlib
import hashlib
import json
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from acquire.addresses import expanded, parse_address
from acquire.camera import with_scheme
from acquire.errors import DataError
from acquire.files.picture import check_regular
from live.results.folder import installed_versions

if TYPE_CHECKING:
    from live.replay.batch.task import Task

_ENDS = 1 << 20  # bytes at each end of a recording that are hashed
_DECIDING = ("phasedic", "numpy", "scipy", "numba", "opencv-python-headless", "machine")
_FILES = ("measure.mask", "camera.dark", "camera.flat")  # settings that name a file


def key_of(task: Task) -> str:
    """The key of ``task``, hexadecimal; it depends on the content of files, not on their paths.

    Raises
    ------
    DataError
        One of its files cannot be read.
    """
    overrides = {key: _file(value) if key in _FILES else value for key, value in task.overrides.items()}
    content = {
        "source": _source(task.source),
        "config": _file(task.config),
        "reference": _file(task.reference),
        "forces": _file(task.forces),
        "part": [task.start_s, task.end_s, task.as_measured],
        "overrides": overrides,
        "versions": deciding_versions(),
    }
    if task.chunk_s is not None:
        content["chunk_s"] = task.chunk_s
    return _hash(json.dumps(content, sort_keys=True, default=str).encode())


def key_of_chunk(task: Task) -> str:
    """The key of a chunk, from that of the whole test, which ``task`` still has."""
    return _hash(json.dumps([task.key, task.numbers, task.run_in]).encode())


def longest_first(tasks: Iterable[Task]) -> list[Task]:
    """Large recordings first, so that none of them runs alone at the end; pictures last."""
    return sorted(tasks, key=_bytes, reverse=True)


def _bytes(task: Task) -> int:
    if not is_session(task.source):
        return 0
    path = expanded(parse_address(with_scheme(task.source)).target)
    with contextlib.suppress(OSError):
        return sum(file.stat().st_size for file in _set_of(path))
    return 0  # removed since; the replay reports it


@cache
def deciding_versions() -> Mapping[str, str]:
    """Versions of all that the numbers depend on."""
    found = installed_versions()
    return {name: found[name] for name in _DECIDING}


def _hash(*pieces: bytes) -> str:
    digest = hashlib.sha256()
    for piece in pieces:
        digest.update(piece)
    return digest.hexdigest()


def is_session(source: str) -> bool:
    """Whether ``source`` is a recording, and not pictures."""
    return parse_address(with_scheme(source)).scheme == "session"


def _source(source: str) -> Any:
    """A recording by its length, beginning and end; pictures by names, lengths and times."""
    address = parse_address(with_scheme(source))
    path = expanded(address.target)
    try:
        if address.scheme == "session":
            return [_ends(file) for file in _set_of(path)]
        return [dict(address.settings), [_stamp(file) for file in _pictures(path)]]
    except OSError as error:
        raise DataError("{path}: cannot be read ({why}); check the path", source, error) from error


def _set_of(path: Path) -> list[Path]:
    """A session and its further files."""
    return [path, *sorted(path.parent.glob(f"{path.stem}.*{path.suffix}"))]


def _pictures(path: Path) -> Iterator[Path]:
    if path.is_dir():
        return iter(sorted(file for file in path.iterdir() if file.is_file()))
    if path.exists():
        return iter([path])
    return iter(sorted(path.parent.glob(path.name)))


def _stamp(file: Path) -> list[Any]:
    about = file.stat()
    return [file.name, about.st_size, about.st_mtime_ns]


def _ends(file: Path) -> list[Any]:
    check_regular(file)
    with file.open("rb") as opened:
        length = file.stat().st_size
        first = opened.read(_ENDS)
        opened.seek(max(0, length - _ENDS))
        return [length, _hash(first, opened.read(_ENDS))]


def _file(path: Any) -> str | None:
    """The hash of the file; None without one."""
    if not path:
        return None
    try:
        check_regular(Path(path))
        return _hash(Path(path).read_bytes())
    except OSError as error:
        raise DataError("{path}: cannot be read ({why}); check the path", path, error) from error
