"""Files and folders that appear complete or not at all, and never replace others."""

from __future__ import annotations

import contextlib
import shutil
from collections.abc import Iterator
from pathlib import Path

from acquire.errors import ConfigError, DataError


def check_free(*paths: Path) -> None:
    """Raise ConfigError where one of ``paths`` exists."""
    for path in paths:
        if path.exists():
            raise ConfigError("{path} exists already and is not overwritten; choose another --out", path)


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
def _atomic(path: Path) -> Iterator[Path]:
    # The suffix decides the format of a film, so it must stay the last.
    part = path.with_name(f"{path.stem}.part{path.suffix}")
    check_free(path, part)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        yield part
        check_free(path)
        part.rename(path)
    except OSError as error:
        _remove(part)
        raise DataError(
            "{path}: cannot be written ({why}); make room or choose another --out",
            path,
            error.strerror or error,
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
