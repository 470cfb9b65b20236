"""The tests of a batch (sessions, folders of pictures, or a list file), and the key of the result of each.

A list in CSV has a heading, a list in TOML a table ``[[test]]`` for each test: ``source``, and if needed ``name``,
``config``, ``reference``, ``load`` (all except the name relative to the list), and keys of the configuration such as
``specimen.width_mm``. The key is a hash of all that a result depends on: recording or pictures, settings, versions.
"""

from __future__ import annotations

import contextlib
import csv
import hashlib
import json
import tomllib
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from acquire.addresses import expanded, parse_address
from acquire.camera import with_scheme
from acquire.errors import ConfigError, DataError
from acquire.files.picture import check_regular, read_bytes
from acquire.text import Message
from acquire.text.message import printable
from live.results.folder import installed_versions

if TYPE_CHECKING:
    from live.replay.batch.task import Task

LISTS = (".toml", ".csv")
_PICTURES = (".tif", ".tiff", ".png", ".bmp", ".jpg", ".jpeg", ".pgm")
_OWN = ("source", "name", "config", "reference", "load")
_SESSION = "session.h5"

_ENDS = 1 << 20  # bytes at each end of a recording that are hashed
_DECIDING = ("phasedic", "numpy", "scipy", "numba", "opencv-python-headless", "machine")
_FILES = ("measure.mask", "camera.dark", "camera.flat")  # settings that name a file


@dataclass(frozen=True, slots=True)
class BatchJob:
    """One test.

    Attributes
    ----------
    name : str
        Name of the folder of its results; unique.
    source : str
        A session, or an address of pictures.
    config, reference, forces : str or None
        Files of its own.
    overrides : mapping of "section.key" to value
    """

    name: str
    source: str
    config: str | None = None
    reference: str | None = None
    forces: str | None = None
    overrides: Mapping[str, Any] = field(default_factory=dict)


def find_tests(words: Sequence[str]) -> list[BatchJob]:
    """The tests that ``words`` name: paths, globs, addresses, or lists.

    Raises
    ------
    ConfigError
        There is no test, a path is no test, or two have the same name.
    DataError
        A list cannot be read.
    """
    found: list[dict[str, Any]] = []
    for word in words:
        path = Path(word)
        if path.suffix.lower() in LISTS:
            found += [_from_list(path, number, row) for number, row in enumerate(_rows(path), 1)]
        else:
            found += [{"source": source} for source in _sources(word)]
    given = {row["source"]: row for row in reversed(found)}  # a source given twice is one test
    rows = [row for row in found if given[row["source"]] is row or "name" in row]
    return _named(rows)


# -- paths --------------------------------------------------------------------------------------


def _sources(word: str) -> Iterator[str]:
    scheme = parse_address(word).scheme
    if scheme and scheme != "session" and not Path(word).exists():
        yield word
        return
    path = expanded(word.removeprefix("session:"))
    pattern = str(path.relative_to(path.anchor))
    paths = [path] if path.exists() else sorted(Path(path.anchor).glob(pattern))
    if not paths:
        raise ConfigError("{source}: no session and no folder of pictures is there; check the path", word)
    for path in paths:
        yield str(_source(path).absolute())


def _source(path: Path) -> Path:
    if path.is_dir():
        return path / _SESSION if (path / _SESSION).exists() else path
    if path.suffix.lower() in _PICTURES:
        raise ConfigError(
            "{path}: is one picture; give the folder it lies in, or 'files:{folder}/*'", path, path.parent
        )
    return path


# -- names --------------------------------------------------------------------------------------


def _named(rows: Sequence[Mapping[str, Any]]) -> list[BatchJob]:
    names = [str(row.get("name") or _short(row["source"], 1)) for row in rows]
    twice = {name for name, n in Counter(names).items() if n > 1}
    names = [
        _short(row["source"], 2) if name in twice and "name" not in row else name
        for row, name in zip(rows, names, strict=True)
    ]
    for name, n in Counter(names).items():
        if n > 1:
            raise ConfigError("{n} tests are called {name}; give them names in a list (--help)", n, name)
        if printable(name) != name or "/" in name or name.startswith(".") or name in ("summary.csv",):
            raise ConfigError(
                "{name}: a test cannot be called that; give it another name in a list", repr(name)
            )
    return [BatchJob(name, **_without_name(row)) for row, name in zip(rows, names, strict=True)]


def _without_name(row: Mapping[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in row.items() if key != "name"}


def _short(source: str, n: int) -> str:
    """The last ``n`` folders of a path, or the name of the file."""
    path = Path(parse_address(source).target)
    parts = path.parts[:-1] if path.name == _SESSION or "*" in path.name else (*path.parts[:-1], path.stem)
    return "-".join(part for part in parts[-n:] if part not in ("/", "..", "."))


# -- lists --------------------------------------------------------------------------------------


def _rows(path: Path) -> list[dict[str, Any]]:
    try:
        text = read_bytes(path).decode("utf-8-sig")
        rows = _toml(text) if path.suffix.lower() == ".toml" else _csv(text)
    except (UnicodeDecodeError, csv.Error, ValueError, RecursionError) as error:
        raise DataError("{path}: the list cannot be read: {why}", path, error) from None
    if not rows:
        raise DataError("{path}: lists no test; wanted: [[test]] tables, or a CSV with a column source", path)
    return rows


def _toml(text: str) -> list[dict[str, Any]]:
    tables = tomllib.loads(text).get("test")
    if not isinstance(tables, list):
        return []
    return [_flat(table) for table in tables if isinstance(table, Mapping)]


def _flat(table: Mapping[str, Any]) -> dict[str, Any]:
    """``specimen.width_mm = 20`` and a table ``specimen`` with ``width_mm`` give the same key."""
    found: dict[str, Any] = {}
    for key, value in table.items():
        if isinstance(value, Mapping):
            found |= {f"{key}.{inner}": one for inner, one in value.items()}
        else:
            found[key] = value
    return found


def _csv(text: str) -> list[dict[str, Any]]:
    lines = [line for line in text.splitlines() if line.strip() and not line.startswith("#")]
    parting = ";" if lines and ";" in lines[0] else ","
    rows = csv.DictReader(lines, delimiter=parting, strict=True)
    return [
        {
            key.strip(): _value(key, cell.strip())
            for key, cell in row.items()
            if isinstance(cell, str) and cell
        }
        for row in rows
        if None not in row or _refuse(row)
    ]


def _refuse(row: Mapping[Any, Any]) -> bool:
    raise ValueError(f"a line has more cells than the heading: {', '.join(map(str, row.values()))[:60]}")


def _value(key: str, cell: str) -> Any:
    """The value of a setting in TOML where ``cell`` is valid TOML, else text."""
    if "." not in key:
        return cell
    try:
        return tomllib.loads(f"value = {cell}")["value"]
    except tomllib.TOMLDecodeError:
        return cell


def _from_list(path: Path, number: int, row: Mapping[str, Any]) -> dict[str, Any]:
    unknown = [key for key in row if key not in _OWN and "." not in key]
    if unknown or not isinstance(row.get("source"), str):
        what = Message("unknown: {keys}", ", ".join(unknown)) if unknown else Message("no source")
        raise ConfigError(
            "{path}: test {number}: {what}; there are {known} and keys such as specimen.width_mm",
            path,
            number,
            what,
            ", ".join(_OWN),
        )
    beside = {key: _beside(path, str(row[key])) for key in _OWN if key in row and key != "name"}
    beside["source"] = (
        str(_source(Path(beside["source"]))) if _is_path(beside["source"]) else beside["source"]
    )
    if "load" in beside:
        beside["forces"] = beside.pop("load")
    found: dict[str, Any] = {**beside, "overrides": {key: row[key] for key in row if "." in key}}
    return found | ({"name": str(row["name"])} if "name" in row else {})


def _is_path(source: str) -> bool:
    return not parse_address(source).scheme


def _beside(path: Path, word: str) -> str:
    """A path or an address of pictures relative to the list."""
    address = parse_address(word)
    scheme = f"{address.scheme}:" if address.scheme else ""
    rest = word.removeprefix(scheme)
    return f"{scheme}{(path.absolute().parent / expanded(rest))}"


def key_of(task: Task) -> str:
    """The key of ``task``, hexadecimal; it depends on the content of files, not on their paths.

    Raises
    ------
    DataError
        One of its files cannot be read.
    """
    overrides = {key: _file(value) if key in _FILES else value for key, value in task.overrides.items()}
    content = {
        "source": _of_source(task.source),
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


def _of_source(source: str) -> Any:
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
