"""Set-up before a test: camera, load cell, region, gauges and check of one rig, joined for the page.

Several cameras of a test are checked, saved and started together.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquire.errors import DataError
from acquire.frame import CameraInfo, Frame
from acquire.text.message import printable
from live.config.cameras import BACK
from live.config.loading import Config
from live.config.sections import DEFAULT_BURST
from live.results.maps.painting import overlay_cells
from live.setup.scale import Board, Scale, from_board
from live.ui.web.broadcaster import Broadcaster
from live.ui.web.map_view import as_jpeg, gauge_shapes, mark_saturated, plate_shapes, shrunk
from live.ui.web.setup.camera_preview import CameraPreview
from live.ui.web.setup.config_draft import ConfigDraft, DeviceLists
from live.ui.web.setup.load_preview import LoadPreview
from live.ui.web.setup.specimen_check import SpecimenCheck, camera_values, quality_colours, recent_stack
from live.ui.web.setup.specimen_region import DrawnRegion, SpecimenRegion

PICTURE_S = 0.2
OVERLAYS = ("saturated", "quality")
SPECIMEN_KEYS = ("width_mm", "thickness_mm", "diameter_mm", "gauge_length_mm", "axis")


class SetupSession:
    """The set-up of a rig; reads camera and load cell from ``with`` to its end.

    Parameters
    ----------
    draft : ConfigDraft
    broadcaster : Broadcaster
        Gets the state for the pages.
    drawn : DrawnRegion, optional
        The region of the last specimen.
    side : str
        The name of the camera; empty where there is only one.
    first : SetupSession, optional
        That of the first camera of several, which has the load cell and the specimen.

    Attributes
    ----------
    picture : bytes
        The newest picture with its overlays, as JPEG.
    preview : CameraPreview
    load : LoadPreview
    region : SpecimenRegion
    check : SpecimenCheck
    devices : DeviceLists
    """

    def __init__(
        self,
        draft: ConfigDraft,
        broadcaster: Broadcaster,
        drawn: DrawnRegion | None = None,
        side: str = "",
        first: SetupSession | None = None,
    ) -> None:
        self.draft, self._broadcaster = draft, broadcaster
        self.side, self._first = side, first
        self.picture = b""
        self.overlays = {"saturated": True, "quality": False}
        self._remarks: list[str] = []
        self._shown = 0
        self._folder = TemporaryDirectory(prefix="phasedic-")
        self._lock = threading.Lock()
        known = DeviceLists(draft)
        self.devices: DeviceLists = known if first is None else first.devices
        self.load: LoadPreview = LoadPreview(draft) if first is None else first.load
        self.preview = CameraPreview(draft, self)
        self.region = SpecimenRegion(draft, drawn, lambda: self.check.discard())
        load = self.load if first is None else None
        self.check: SpecimenCheck = SpecimenCheck(
            draft, self.preview, load, self.region, Path(self._folder.name), self.refresh
        )

    def __enter__(self) -> SetupSession:
        self.preview.start()
        if self._first is None:
            self.load.start()
        self.check.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.preview.close()
        if self._first is None:
            self.load.close()
        self.check.close()
        self._folder.cleanup()

    # -- requests of the page -----------------------------------------------------------------

    def refresh(self) -> None:
        """Send the state to the pages."""
        with self._lock:
            self._broadcaster.publish(f"setup {self.side}".strip(), self.state())

    @property
    def shared(self) -> ConfigDraft:
        """The draft that has load cell, specimen and metadata."""
        return self.draft if self._first is None else self._first.draft

    def find(self) -> None:
        """Find the specimen in the last frames; raises DataError where there is no picture or no specimen."""
        self.region.find(self.preview.known, self._recent())

    def scale_from(self, board: Board) -> Scale:
        """The scale from a board in the last frames; raises DataError where there is none."""
        picture = self._recent().mean(axis=0)
        scale = from_board(picture, board, stand_off_mm=self.draft.config.scale.stand_off_mm)
        self._remarks = [printable(remark) for remark in scale.remarks]
        return scale

    def clear_remarks(self) -> None:
        """Remove the remarks on a calibration board: the scale was taken another way."""
        self._remarks = []

    def open_load(self, address: str) -> None:
        """Read another load cell; its zero is its own. Raises ConfigError for an invalid address."""
        self.shared.change_all({"load.address": address, "load.zero_N": 0.0})
        self.check.discard()
        self.load.reopen()

    def ready(self, folder: Path) -> Config:
        """The configuration for a test; raises DataError or ConfigError where a test cannot begin with it."""
        return self.region.ready(folder)

    def state(self) -> dict[str, Any]:
        """The state of the set-up, as the page shows it."""
        info, config, drawn = self.preview.info, self.draft.config, self.region.drawn
        m, specimen = config.measure, replace(self.shared.config.specimen, axis=config.specimen.axis)
        region = drawn and {"words": drawn.origin, "box": drawn.box, "edition": self.region.edition}
        return {
            **self.check.values,
            "side": self.side,
            "remarks": self._remarks,
            "trouble": self.preview.trouble,
            "camera": None if info is None else camera_values(info),
            "address": config.camera.address,
            "load": self.load.state(),
            "devices": self.devices.state(),
            "picture": self._shown,
            "overlays": self.overlays,
            "region": region,
            "gauges": gauge_shapes(config),
            "can": self.region.can,
            "plates": plate_shapes(config),
            "measure": {"zoi": m.zoi, "step": m.step, "burst": m.burst or DEFAULT_BURST},
            "specimen": {key: getattr(specimen, key) for key in SPECIMEN_KEYS}
            | {"area_mm2": None if specimen.area_m2 is None else specimen.area_m2 * 1e6},
            "metadata": dict(self.shared.config.metadata),
            "scale": {"px_per_mm": config.scale.px_per_mm, "sigma": config.scale.sigma_mm_per_px},
            "unsaved": sorted(self.draft.changes),
            "file": str(self.draft.path),
        }

    # -- the camera ---------------------------------------------------------------------------

    def _recent(self) -> NDArray[np.float32]:
        """(N, H, W), the last frames; a slow camera has given few."""
        frames = self.preview.recent(1)
        if not frames:
            raise DataError("the camera has given no picture yet")
        return recent_stack(frames)

    def frames_needed(self, info: CameraInfo) -> int:
        """Frames of a whole check."""
        return self.check.frames_needed(info)

    def opened(self, info: CameraInfo) -> None:
        """Another camera: what was found of the one before does not hold."""
        self.check.values["checking"] = False
        self.check.discard()
        self.region.opened(info)

    def show(self, frame: Frame) -> float:
        """Draw the picture while a page is open; when to draw again."""
        began = time.monotonic()
        if self._broadcaster.open_pages:
            picture, scale = shrunk(frame.image, frame.bits)
            figures = self.check.figures
            if self.overlays["quality"] and figures is not None:
                overlay_cells(picture, scale, figures.zois.grid, quality_colours(figures))
            if self.overlays["saturated"]:
                mark_saturated(picture, scale, frame.image, frame.saturation)
            self.picture = as_jpeg(picture)
            self._shown += 1
        self.refresh()
        return max(began + PICTURE_S, time.monotonic() + 2 * (time.monotonic() - began))


class SetupSessions:
    """One session for each camera, from ``with`` to its end.

    Parameters
    ----------
    drafts : mapping of str to ConfigDraft
        Of each camera by its name, the first one first.
    broadcaster : Broadcaster
    drawn : mapping of str to DrawnRegion
        The regions of the last specimen, by the names of the cameras; "" of a single one.

    Attributes
    ----------
    first : SetupSession
    by_name : dict of str to SetupSession
    """

    def __init__(
        self, drafts: Mapping[str, ConfigDraft], broadcaster: Broadcaster, drawn: Mapping[str, DrawnRegion]
    ) -> None:
        (name, draft), *others = drafts.items()
        self.first = SetupSession(draft, broadcaster, drawn.get(name), name)
        self.by_name = {name: self.first}
        for name, draft in others:
            self.by_name[name] = SetupSession(draft, broadcaster, drawn.get(name), name, self.first)
        self._open = ExitStack()

    def __enter__(self) -> SetupSessions:
        with ExitStack() as opened:
            for session in self.by_name.values():
                opened.enter_context(session)
            self._open = opened.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        self._open.close()

    def of(self, name: object) -> SetupSession:
        """The session of a camera; the first for any other name."""
        return self.by_name.get(name, self.first) if isinstance(name, str) else self.first

    @property
    def drawn(self) -> dict[str, DrawnRegion]:
        """The regions by the names of the cameras."""
        found = {name: session.region.drawn for name, session in self.by_name.items()}
        return {name: drawn for name, drawn in found.items() if drawn is not None}

    @property
    def pictures(self) -> dict[str, bytes]:
        """The newest picture of each, as JPEG."""
        return {name: session.picture for name, session in self.by_name.items()}

    def check(self) -> None:
        """Check all cameras; raises DataError where one has given no picture."""
        for session in self.by_name.values():
            session.check.begin()

    def save(self) -> None:
        """Write each rig file, that of the first last; raises ConfigError where one cannot be written."""
        paths = []
        for session in list(self.by_name.values())[1:]:
            session.region.save()
            paths.append(str(session.draft.path))
        if paths:
            further = {"camera.back": paths[0]} if BACK in self.by_name else {"camera.beside": paths}
            self.first.draft.change_all(further)
        self.first.region.save()

    def ready(self, folder: Path) -> list[Config]:
        """The configuration of each camera for a test; raises DataError or ConfigError where one cannot begin."""
        return [session.ready(folder) for session in self.by_name.values()]

    def configs(self, folder: Path) -> list[Config]:
        """The configuration of each camera; raises DataError or ConfigError."""
        return [session.region.config(folder) for session in self.by_name.values()]

    def refresh(self) -> None:
        """Send the state of each to the pages."""
        for session in self.by_name.values():
            session.refresh()
