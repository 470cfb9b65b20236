"""Files and folders that appear whole or not at all, and never in place of others."""

from __future__ import annotations

import contextlib
import shutil
from collections.abc import Iterator
from pathlib import Path

from acquire.errors import ConfigError, DataError


def check_free(*paths: Path) -> None:
    """Raise ConfigError where one of ``paths`` is there already."""
    for path in paths:
        if path.exists():
            raise ConfigError(f"{path} exists already and is not overwritten; choose another --out")


@contextlib.contextmanager
def new_file(path: Path) -> Iterator[Path]:
    """A path beside ``path`` to write to; it takes its name when all went well, and else is removed.

    Raises
    ------
    ConfigError
        ``path`` is taken.
    DataError
        It cannot be written.
    """
    with _appearing(path) as part:
        yield part


@contextlib.contextmanager
def new_folder(path: Path) -> Iterator[Path]:
    """The same for a folder, which is there and empty."""
    with _appearing(path) as part:
        part.mkdir()
        yield part


@contextlib.contextmanager
def _appearing(path: Path) -> Iterator[Path]:
    # A film is told its format by its suffix, so this must stay the last.
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
            f"{path}: cannot be written ({error.strerror or error}); make room or choose another --out"
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
