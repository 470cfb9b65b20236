"""The devices to choose from during set-up, searched in threads of their own: cameras, serial ports, sessions."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from acquire.camera import CameraListing, list_cameras
from acquire.errors import PhasedicError
from acquire.serial_line import identify
from acquire.serial_line.identify import Finding
from acquire.serial_line.ports import LineSettings, PortInfo, list_serial_ports
from acquire.settings import settings_of
from acquire.text import Message
from acquire.text.message import brief, printable
from live.setup.devices import camera_settings, load_settings
from live.ui.web.setup.config_draft import ConfigDraft

log = logging.getLogger(__name__)

MAX_SESSIONS = 20
Cameras = Callable[[], list[CameraListing]]
Ports = Callable[[], list[PortInfo]]


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
