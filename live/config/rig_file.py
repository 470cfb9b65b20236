"""Write and change a rig file: its comments and order stay, and ``load_config`` accepts the result.

The new text is checked in a temporary file first; an impossible value changes nothing. A change keeps the former
file as ``NAME.bak``.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from acquire.errors import ConfigError, DataError
from live.config.loading import Config, as_toml, load_config, toml_text
from live.config.new_files import check_free, replaced_file

if TYPE_CHECKING:
    from tomlkit import TOMLDocument


def new_rig(path: Path, text: str, changes: Mapping[str, Any] | None = None) -> Config:
    """Write ``text``, with ``changes`` as in ``write_rig``, as a new rig file; returns its configuration.

    Raises
    ------
    ConfigError
        The file exists (nothing is overwritten) or cannot be written, or the text is not a configuration.
    """
    check_free(path)
    return _write_checked(path, _changed(_parsed(text, path), changes or {}, path))


def write_rig(path: Path, changes: Mapping[str, Any], gauges: Sequence[str] = ()) -> Config:
    """Change keys of a rig file, or make a new file of them; returns its configuration.

    Parameters
    ----------
    path : Path
        The former file is kept beside it as ``NAME.bak``.
    changes : mapping of "section.key" or "gauges.NAME" to a value
        Numbers, texts, flags, lists; for a gauge a mapping of its keys. None removes the key or gauge.
    gauges : sequence of str
        Their order; without, new ones come last.

    Raises
    ------
    ConfigError
        The file is not TOML, or the result is not a configuration; then nothing is changed.
    """
    path = path.resolve()  # a symbolic link stays a link
    document = _read(path)
    text = _changed(document, changes, path)
    return _write_checked(path, _in_order(document, gauges) or text)


def _in_order(document: TOMLDocument, names: Sequence[str]) -> str:
    """The document with its gauges in this order; empty where they are so already."""
    table: Any = document.get("gauges", {})
    if [name for name in names if name in table] == list(table):
        return ""
    for name in names:
        if name in table:
            table[name] = table.pop(name)
    return document.as_string()


def _changed(document: TOMLDocument, changes: Mapping[str, Any], path: Path) -> str:
    for dotted, value in changes.items():
        section, _, key = dotted.partition(".")
        if not key:
            raise ConfigError(
                "{path}: {dotted}: a change names a section and a key, as measure.zoi", path, dotted
            )
        _change(document, section, key, value, path)
    return document.as_string()


def _read(path: Path) -> TOMLDocument:
    with as_toml(path):
        return _parsed(toml_text(path) if path.exists() else "", path)


def _parsed(text: str, path: Path) -> TOMLDocument:
    import tomlkit
    from tomlkit.exceptions import TOMLKitError

    with as_toml(path):
        try:
            return tomlkit.parse(text)
        except TOMLKitError as error:  # some are no ValueError
            raise ValueError(error) from None


def _change(document: TOMLDocument, section: str, key: str, value: Any, path: Path) -> None:
    import tomlkit

    if section not in document:
        if value is None:
            return
        document.add(section, tomlkit.table(is_super_table=section in ("gauges", "plate")))
    table: Any = document[section]
    if not isinstance(table, Mapping):
        raise ConfigError(
            "{path}: {section} must be a section, [{section}] with keys below it", path, section
        )
    if value is None:
        table.pop(key, None)  # type: ignore[attr-defined]
    else:
        table[key] = _toml_value(value)  # type: ignore[index]


def _toml_value(value: Any) -> Any:
    """A value that TOML can hold: a tuple becomes a list, a key of None is left out."""
    if isinstance(value, Mapping):
        return {key: _toml_value(v) for key, v in value.items() if v is not None}
    return [_toml_value(v) for v in value] if isinstance(value, list | tuple) else value


def _write_checked(path: Path, text: str) -> Config:
    """Check ``text``, write it into a temporary file, then replace ``path`` by that."""
    try:
        with replaced_file(path) as part:
            with part.open("x", encoding="utf-8") as file:
                file.write(text)
                file.flush()
                os.fsync(file.fileno())
            config = load_config(path, {}, text)
            if path.exists():
                shutil.copymode(path, part)
                shutil.copy2(path, path.with_name(f"{path.name}.bak"))
    except DataError as error:
        raise ConfigError(error.text) from None
    return config
