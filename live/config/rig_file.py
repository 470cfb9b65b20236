"""The rig file written and changed: comments and order kept, and only what ``load_config`` accepts.

What is to be written is checked in a file beside it first; an impossible value leaves everything as it was.
What stood there before a change is kept as ``NAME.bak``.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any
from uuid import uuid4

from acquire.errors import ConfigError, DataError
from acquire.files.picture import read_bytes
from live.config.loading import MAX_BYTES, Config, load_config

if TYPE_CHECKING:
    from tomlkit import TOMLDocument


def new_rig(path: Path, text: str, changes: Mapping[str, Any] | None = None) -> Config:
    """Write ``text``, with ``changes`` as in ``write_rig``, as a new rig file; the configuration that it makes.

    Raises
    ------
    ConfigError
        There is a file already (nothing is overwritten), it cannot be written, or the text is no configuration.
    """
    if path.exists() or path.is_symlink():
        raise ConfigError(f"{path} exists; nothing is overwritten, choose another name")
    return _write_checked(path, _changed(_parsed(text, path), changes or {}, path))


def write_rig(path: Path, changes: Mapping[str, Any]) -> Config:
    """Change some keys of a rig file, or make a new one of them; the configuration that it makes.

    Parameters
    ----------
    path : Path
        What stood there is kept beside it, as ``NAME.bak``.
    changes : mapping of "section.key" or "gauges.NAME" to a value
        Numbers, texts, flags, lists; for a gauge a mapping of its keys. None takes the key or gauge out.

    Raises
    ------
    ConfigError
        The file is no TOML, or would not be a configuration; then nothing is changed.
    """
    path = path.resolve()  # a link stays one
    return _write_checked(path, _changed(_read(path), changes, path))


def _changed(document: TOMLDocument, changes: Mapping[str, Any], path: Path) -> str:
    for dotted, value in changes.items():
        section, _, key = dotted.partition(".")
        if not key:
            raise ConfigError(f"{path}: {dotted}: a change names a section and a key, as measure.zoi")
        _change(document, section, key, value, path)
    return document.as_string()


def _read(path: Path) -> TOMLDocument:
    if not path.exists():
        return _parsed("", path)
    try:
        return _parsed(read_bytes(path, MAX_BYTES).decode("utf-8-sig"), path)
    except (DataError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: cannot be read ({error}); give a text file in TOML") from None


def _parsed(text: str, path: Path) -> TOMLDocument:
    import tomlkit
    from tomlkit.exceptions import TOMLKitError

    try:
        return tomlkit.parse(text)
    except RecursionError:
        raise ConfigError(f"{path}: not valid TOML: too many brackets within brackets") from None
    except (TOMLKitError, ValueError) as error:
        raise ConfigError(f"{path}: not valid TOML: {error}") from None


def _change(document: TOMLDocument, section: str, key: str, value: Any, path: Path) -> None:
    import tomlkit

    if section not in document:
        if value is None:
            return
        document.add(section, tomlkit.table(is_super_table=section == "gauges"))
    table: Any = document[section]
    if not isinstance(table, Mapping):
        raise ConfigError(f"{path}: {section} must be a section, [{section}] with keys below it")
    if value is None:
        table.pop(key, None)  # type: ignore[attr-defined]
    else:
        table[key] = _toml_value(value)  # type: ignore[index]


def _toml_value(value: Any) -> Any:
    """What TOML has: a tuple is a list, a key of None is none."""
    if isinstance(value, Mapping):
        return {key: _toml_value(v) for key, v in value.items() if v is not None}
    return [_toml_value(v) for v in value] if isinstance(value, list | tuple) else value


def _write_checked(path: Path, text: str) -> Config:
    """Checked as a file of its own, then put in the place of what was there."""
    part = path.with_name(f".{path.name}.{uuid4().hex[:8]}.part")
    try:
        with part.open("x", encoding="utf-8") as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        config = _checked(part, path)
        if path.exists():
            shutil.copymode(path, part)
            shutil.copy2(path, path.with_name(f"{path.name}.bak"))
        part.replace(path)
    except OSError as error:
        raise ConfigError(f"{path}: cannot be written ({error.strerror}); choose another place") from None
    finally:
        part.unlink(missing_ok=True)
    return config


def _checked(part: Path, path: Path) -> Config:
    try:
        return load_config(part, {})
    except ConfigError as error:
        raise ConfigError(str(error).replace(str(part), str(path))) from None
