"""The configuration during set-up: as it was loaded, with the changes that are not saved yet."""

from __future__ import annotations

import json
import re
import threading
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquire.errors import ConfigError, DataError
from acquire.files.picture import write_picture
from acquire.text import Message
from live.config.cameras import camera_configs, other_cameras
from live.config.gauges import GaugeTable
from live.config.loading import Config, from_dict, load_config, other_shapes, settings_in
from live.config.new_files import free_name
from live.config.rig_file import write_rig

CHANGEABLE = frozenset(
    {
        "camera.address", "camera.back", "camera.beside", "load.address",
        "measure.zoi", "measure.step", "measure.burst", "measure.roi",
        "measure.mask", "measure.gauges",
        "specimen.width_mm", "specimen.thickness_mm", "specimen.diameter_mm", "specimen.area_mm2",
        "specimen.gauge_length_mm", "specimen.axis", "specimen.standard", "metadata.specimen", "metadata.operator",
        "metadata.material", "metadata.note", "load.zero_N", "scale.mm_per_px",
        "scale.sigma_mm_per_px", "scale.date", "scale.method",
    }
)  # fmt: skip
"""Keys that a page may change, beside gauges."""

TRANSIENT = ("output.", "view.", "load.zero_N")
"""Keys with these beginnings are of one test, and not saved."""

_NUMBERED = re.compile(r"^(.*?)-?(\d{1,6})$")


class ConfigDraft:
    """A configuration with its changes.

    Parameters
    ----------
    given : Config
        Of the file and the command line.
    path : Path
        Of the rig file; it need not exist yet.
    overrides : mapping of "section.key" to value
        Of the command line: saved with the changes, except for ``TRANSIENT``.

    Attributes
    ----------
    changes : dict of "section.key" to value
        Not saved yet; None removes a key.
    overrides : mapping of "section.key" to value
    """

    def __init__(self, given: Config, path: Path, overrides: Mapping[str, Any]) -> None:
        self.path, self.overrides = path, overrides
        self._transient = {key: value for key, value in overrides.items() if key.startswith(TRANSIENT)}
        in_file = settings_in(path) if path.exists() else {}
        permanent = {key: value for key, value in overrides.items() if key not in self._transient}
        permanent |= {key: None for key in other_shapes(permanent) if key in in_file}
        self.changes: dict[str, Any] = {key: v for key, v in permanent.items() if in_file.get(key) != v}
        self._config = given
        # The page and the check change it, each in a thread of its own.
        self._lock = threading.Lock()

    @property
    def config(self) -> Config:
        """The configuration with all changes."""
        return self._config

    def change_all(self, changes: Mapping[str, Any]) -> None:
        """Change keys, all or none; raises ConfigError for an invalid value, and changes nothing then."""
        with self._lock:
            self._change_all(changes)

    def replace_gauges(
        self, gauges: Mapping[str, GaugeTable], changes: Mapping[str, Any] | None = None
    ) -> None:
        """Take these gauges in place of all, in their order, and change other keys; raises as ``change_all``."""
        with self._lock:
            before = self._config.gauges
            self._change_all(changes or {}, gauges)
            self.changes |= {f"gauges.{name}": None for name in before if name not in gauges}
            self.changes |= {
                f"gauges.{name}": dict(table) for name, table in gauges.items() if before.get(name) != table
            }

    def _change_all(self, changes: Mapping[str, Any], gauges: Mapping[str, GaugeTable] | None = None) -> None:
        tree: dict[str, Any] = json.loads(json.dumps(self._config.as_dict()))
        changes = dict.fromkeys(other_shapes(changes)) | dict(changes)
        if gauges is not None:
            tree["gauges"] = json.loads(json.dumps(dict(gauges)))
        for dotted, value in changes.items():
            section, _, key = dotted.partition(".")
            if section != "gauges" and dotted not in CHANGEABLE:
                raise ConfigError("{dotted} cannot be changed here; change it in {path}", dotted, self.path)
            if value is None:
                tree[section].pop(key, None)
            else:
                tree[section][key] = value
        self._config = from_dict(tree, {}, Message("the page"))
        self.changes |= {key: value for key, value in changes.items() if not key.startswith(TRANSIENT)}

    def save(self, mask: NDArray[np.bool_] | None) -> None:
        """Write the changes into the rig file and ``mask`` into a picture beside it; the old rig file is kept.

        Raises
        ------
        ConfigError
            A file cannot be written; then nothing is changed.
        """
        with self._lock:
            if mask is not None:
                self._change_all({"measure.mask": str(self._write_mask(mask))})
            write_rig(self.path, self.changes, list(self._config.gauges))
            zero = {"load.zero_N": self._config.load.zero_N}
            self._config = load_config(self.path, self._transient | zero)
            self.changes = {}

    def _write_mask(self, mask: NDArray[np.bool_]) -> Path:
        """Write a new file each time: a rig file kept as .bak refers to the old one."""
        stem = self.path.resolve().with_suffix("")
        name = free_name(f"{stem.name}-mask", lambda name: stem.with_name(f"{name}.png").exists())
        path = stem.with_name(f"{name}.png")
        try:
            write_picture(path, mask.astype(np.uint8) * 255)
        except DataError as error:
            raise ConfigError(error.text) from None
        return path


def drafts_of(first: ConfigDraft) -> dict[str, ConfigDraft]:
    """Those of all cameras by name, ``first`` the first; each further one has a rig file of its own.

    Raises
    ------
    ConfigError
        As of ``camera_configs``.
    """
    leading, *further = camera_configs(first.config, first.overrides).items()
    others = zip(further, other_cameras(first.config), strict=True)
    return {leading[0]: first, **{name: _draft(first, name, own, given) for (name, own), given in others}}


def _draft(first: ConfigDraft, name: str, own: Config, given: str) -> ConfigDraft:
    """Draft of a further camera, ``given`` by its rig file or its address."""
    if given.lower().endswith(".toml"):
        return ConfigDraft(own, Path(given), {})
    values, usual = own.as_dict(), Config().as_dict()
    taken = {
        f"{section}.{key}": value
        for section in ("measure", "scale", "gauges")
        for key, value in values[section].items()
        if value != usual[section].get(key)
    }
    path = first.path.with_stem(f"{first.path.stem}-{name}")
    return ConfigDraft(own, path, {"camera.address": given, **taken})


def next_name(name: str) -> str:
    """The name of the next specimen: bar-7 after bar-6."""
    found = _NUMBERED.match(name)
    if found is None:
        return f"{name}-2"
    stem, number = found[1], found[2]
    dash = "-" if name[len(stem) :].startswith("-") else ""
    return f"{stem}{dash}{int(number) + 1:0{len(number)}d}"
