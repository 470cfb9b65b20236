"""Files and folders that appear complete or not at all; names that are free."""

from __future__ import annotations

import contextlib
import itertools
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from uuid import uuid4

from acquire.errors import ConfigError, DataError


def free_name(wanted: str, is_taken: Callable[[str], bool], mark: str = "-") -> str:
    """``wanted``, or where it is taken the first of ``wanted-2``, ``wanted-3`` ... that is not."""
    names = itertools.chain([wanted], (f"{wanted}{mark}{n}" for n in itertools.count(2)))
    return next(name for name in names if not is_taken(name))


def check_free(*paths: Path) -> None:
    """Raise ConfigError where one of ``paths`` exists."""
    for path in paths:
        if path.exists() or path.is_symlink():
            raise ConfigError("{path} exists already and is not overwritten; choose another name", path)


def made_folder(folder: Path) -> Path:
    """The folder, made where it is not there; raises ConfigError where that cannot be."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ConfigError("{folder}: cannot be made ({why}); choose another --out", folder, error) from None
    return folder


@contextlib.contextmanager
def new_file(path: Path) -> Iterator[Path]:
    """A path beside ``path`` to write to; it is renamed to ``path`` at the end, and removed after an error.

    Raises
    ------
    ConfigError
        ``path`` exists.
    DataError
        It cannot be written.
    """
    with _atomic(path) as part:
        yield part


@contextlib.contextmanager
def new_folder(path: Path) -> Iterator[Path]:
    """The same for a folder, which is created empty."""
    with _atomic(path) as part:
        part.mkdir()
        yield part


@contextlib.contextmanager
def replaced_file(path: Path) -> Iterator[Path]:
    """The same for a file that may be there, and is replaced; several threads and processes may do so at once."""
    with _atomic(path, f".{uuid4().hex[:8]}", replaces=True) as part:
        yield part


@contextlib.contextmanager
def _atomic(path: Path, mark: str = "", *, replaces: bool = False) -> Iterator[Path]:
    # The suffix decides the format of a film, so it must stay the last.
    part = path.with_name(f"{path.stem}{mark}.part{path.suffix}")
    given = () if replaces else (path,)
    check_free(*given)
    if part.exists() and not replaces:
        raise ConfigError(
            "{part} is there: another command writes it, or was killed; remove it then, or choose another --out",
            part,
        )
    try:
        if not replaces:
            path.parent.mkdir(parents=True, exist_ok=True)
        yield part
        check_free(*given)
        (part.replace if replaces else part.rename)(path)
    except OSError as error:
        _remove(part)
        raise DataError(
            "{path}: cannot be written ({why}); make room or choose another place",
            path,
            error,
        ) from error
    except BaseException:
        _remove(part)
        raise


def _remove(part: Path) -> None:
    with contextlib.suppress(OSError):
        if part.is_dir():
            shutil.rmtree(part)
        else:
            part.unlink(missing_ok=True)
