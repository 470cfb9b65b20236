"""The configuration during set-up, as loaded and with changes that are not saved yet; and the devices to choose from.

Cameras, serial ports and sessions are searched in threads of their own.
"""

from __future__ import annotations

import json
import logging
import re
import threading
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquire.camera import CameraListing, list_cameras
from acquire.errors import ConfigError, DataError, PhasedicError
from acquire.files.picture import write_picture
from acquire.serial_line import identify
from acquire.serial_line.identify import Finding
from acquire.serial_line.ports import LineSettings, PortInfo, list_serial_ports
from acquire.settings import settings_of
from acquire.text import Message
from acquire.text.message import brief, printable
from live.config.cameras import camera_configs, other_cameras
from live.config.gauges import GaugeTable
from live.config.loading import Config, from_dict, load_config, other_shapes, settings_in
from live.config.new_files import free_name
from live.config.rig_file import write_rig
from live.setup.devices import camera_settings, load_settings

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

log = logging.getLogger(__name__)

MAX_SESSIONS = 20
Cameras = Callable[[], list[CameraListing]]
Ports = Callable[[], list[PortInfo]]


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


class DeviceLists:
    """What ``search`` and ``identify`` have found.

    Parameters
    ----------
    draft : ConfigDraft
        Its folder of results has the recorded sessions.
    cameras, ports : callable
        Give what there is; for tests.
    """

    def __init__(
        self, draft: ConfigDraft, cameras: Cameras = list_cameras, ports: Ports = list_serial_ports
    ) -> None:
        self._draft, self._list_cameras, self._list_ports = draft, cameras, ports
        self._cameras: list[CameraListing] = []
        self._loads: list[dict[str, str]] = []
        self._finding = ""
        self._busy = threading.Lock()

    def search(self) -> None:
        """Search again, unless a search is under way."""
        self._begin()

    def identify(self, port: str) -> None:
        """Listen on a serial port for a load cell; nothing is sent."""
        self._begin(port)

    def state(self) -> dict[str, Any]:
        """The lists as the page shows them."""
        return {
            "cameras": [_shown(one) for one in self._cameras],
            "loads": self._loads,
            "finding": self._finding,
        }

    def _begin(self, port: str | None = None) -> None:
        if self._busy.acquire(blocking=False):
            threading.Thread(target=self._work, args=(port,), name="page-devices", daemon=True).start()

    def _work(self, port: str | None) -> None:
        try:
            if port is None:
                self._search()
            else:
                self._identify(port)
        except PhasedicError as error:
            self._finding = printable(brief(error))
        except Exception as error:
            log.exception("the search for devices failed")
            self._finding = Message("the search failed: {error}", repr(error))
        finally:
            self._busy.release()

    def _search(self) -> None:
        self._finding = Message("searching …")
        recorded = [CameraListing(address, Message("recorded session")) for address in self._sessions()]
        simulated = [
            CameraListing("sim:", Message("simulated")),
            CameraListing("sim:hole", Message("simulated")),
        ]
        self._cameras = [*self._list_cameras(), *recorded, *simulated]
        others = [
            *recorded,
            CameraListing("sim:", Message("simulated")),
            CameraListing("none:", Message("none")),
        ]
        self._loads = [*(_port(one) for one in self._list_ports()), *map(_shown, others)]
        self._finding = ""

    def _sessions(self) -> Iterator[str]:
        runs = Path(self._draft.config.output.dir or "runs")
        files = sorted(runs.glob("*/session*.h5"), key=lambda path: path.stat().st_mtime)
        return (f"session:{path}" for path in files[-MAX_SESSIONS:])

    def _identify(self, port: str) -> None:
        self._finding, heard = Message("listening at all speeds …"), []
        for baud, received, finding in identify.listen(port):
            heard.append((baud, received))
            if finding is not None:
                self._offer(finding)
                self._finding = Message("found: {protocol}; choose it in the list", finding.protocol)
                return
        proposals = (identify.proposed(LineSettings(port, baud), received) for baud, received in heard)
        made = next((one for one in proposals if one is not None), None)
        if made is not None:
            self._offer(made)
            shown = printable(made.lines[-1].decode("ascii", "backslashreplace").strip())
            self._finding = Message(
                "no protocol knows lines such as {shown}: a pattern made from them is in the list; {remark}",
                repr(shown),
                made.remark,
            )
            return
        self._finding = Message("nothing recognised: check cable and power, or write the address")

    def _offer(self, finding: Finding) -> None:
        """The address of a port first in the list of load cells."""
        known = [one for one in self._loads if one["address"] != finding.address]
        self._loads = [{"address": finding.address, "name": finding.protocol}, *known]


def kinds_of_devices() -> dict[str, dict[str, list[dict[str, str]]]]:
    """The settings of an address of each kind of camera and load cell, by scheme, as the page shows them."""
    return {
        what: {
            scheme: [
                {"key": one.key, "default": one.plain_default, "unit": one.unit, "words": one.words}
                for one in settings_of(kind)
            ]
            for scheme, kind in kinds.items()
        }
        for what, kinds in (("camera", camera_settings()), ("load", load_settings()))
    }


def _shown(one: CameraListing) -> dict[str, str]:
    return {"address": one.address, "name": printable(one.name), "trouble": printable(one.trouble)}


def _port(one: PortInfo) -> dict[str, str]:
    trouble = "" if one.accessible else Message("this user may not open it")
    return {"address": one.device, "name": printable(one.description), "trouble": trouble}
