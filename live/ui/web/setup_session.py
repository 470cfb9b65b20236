"""Set-up before a test: the live picture, the region drawn on it, and the check of the still specimen.

The camera's thread (``preview``) draws a few pictures a second; another judges the newest (``live.setup.check``).
"""

from __future__ import annotations

import logging
import threading
import time
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from acquire.errors import DataError, PhasedicError
from acquire.files.picture import write_picture
from acquire.frame import CameraInfo, Frame
from acquire.printable import brief, printable
from live.config.gauges import gauges_for
from live.config.loading import Config
from live.config.sections import DEFAULT_BURST, DEFAULT_REFERENCE_BURST
from live.config.values import AUTO, GIVEN
from live.pipeline.latency import OUTPUT, lower_priority
from live.pipeline.warm_up import picture_kinds
from live.results.maps.painting import lay_cells
from live.setup.check.check_list import CheckFigures, examine
from live.setup.check.quick_check import QuickChecker
from live.setup.check.verdict import CheckLine, judge
from live.setup.compiling import compile_ahead
from live.setup.grid import grid_for
from live.setup.pictures import read_mask
from live.setup.placement import auto_gauges
from live.setup.region import region_of
from live.setup.scale import Board, Scale, from_board
from live.ui.web.broadcaster import Broadcaster
from live.ui.web.camera_preview import RECENT, CameraPreview
from live.ui.web.check_panel import camera_values, figure_values, line_values, quality, shots_of, table_values
from live.ui.web.config_draft import ConfigDraft
from live.ui.web.drawn_region import DrawnRegion
from live.ui.web.page_consumer import gauges_of
from live.ui.web.painting import as_jpeg, as_png, mark_saturated, shrunk

log = logging.getLogger(__name__)

PICTURE_S, JUDGE_S = 0.2, 0.4
MOST_BYTES = 400_000_000  # of frames held for a check
OVERLAYS = ("saturated", "quality")
SHADE = (60, 20, 0, 150)
"""Over what is not measured: blue, green, red, opacity."""


class SetupSession:
    """Looks at the camera from the moment it is entered until it is left.

    Parameters
    ----------
    draft : ConfigDraft
    broadcaster : Broadcaster
        Told what there is to see.
    drawn : DrawnRegion, optional
        The region of the specimen before.

    Attributes
    ----------
    picture : bytes
        The newest picture with its overlays, a JPEG.
    drawn : DrawnRegion or None
        None until there is a picture.
    """

    def __init__(
        self, draft: ConfigDraft, broadcaster: Broadcaster, drawn: DrawnRegion | None = None
    ) -> None:
        self.draft, self._broadcaster, self.drawn = draft, broadcaster, drawn
        self.preview = CameraPreview(draft, self._opened, self._show)
        self.picture = b""
        self.overlays = {"saturated": True, "quality": False}
        self._figures: CheckFigures | None = None
        self._watch, self._watched = QuickChecker(draft.config), tuple[Any, ...]()
        self._told: dict[str, Any] = {"table": None, "go": None, "lines": [], "checking": False}
        self._told |= {"doubt": "", "busy": "", "remarks": []}
        self._peak, self._shown, self._edition = 0.0, 0, 0
        self._lock = threading.RLock()
        self._leave = threading.Event()
        self._folder = TemporaryDirectory(prefix="phasedic-")
        self._judging = threading.Thread(target=self._work, name="page-judge", daemon=True)

    def __enter__(self) -> SetupSession:
        self.preview.start()
        self._judging.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._leave.set()
        self.preview.close()
        self._judging.join()
        self._folder.cleanup()

    # -- what the page asks for ---------------------------------------------------------------

    def refresh(self) -> None:
        """Tell the pages anew, after a change."""
        self._broadcaster.tell("setup", self.state())

    def check(self) -> None:
        """Take as many frames as ``phasedic check`` does, and judge them with the table."""
        self.preview.collect(self._enough())
        self._told |= {"checking": True, "go": None}

    def forget_peak(self) -> None:
        """Begin the peak hold of the sharpness anew."""
        self._peak = 0.0

    def region_changed(self) -> None:
        """Judge, and show, the region as it is drawn now."""
        with self._lock:
            self._edition += 1
            self._told |= {"table": None, "go": None, "lines": []}

    def find(self) -> None:
        """Look for the specimen in what is seen now; raises DataError where nothing is seen."""
        frames, info = self.preview.recent(), self.preview.info
        if not frames or info is None:
            raise DataError("the camera has given no picture yet")
        stack = np.stack([frame.image for frame in frames]).astype(np.float32)
        noise = float(np.diff(stack, axis=0).std()) / 2**0.5 / len(stack) ** 0.5 if len(stack) > 1 else None
        m = self.draft.config.measure
        sought = replace(self.draft.config, measure=replace(m, roi=None, mask=None))
        region = region_of(sought, stack.mean(axis=0), noise or None)
        self._take(DrawnRegion(region.inside(info.width, info.height, m.zoi), region.words))

    def scale_from(self, board: Board) -> Scale:
        """The scale from a board in what is seen now; raises DataError where none is."""
        frames = self.preview.recent()
        if not frames:
            raise DataError("the camera has given no picture yet")
        picture = np.stack([frame.image for frame in frames]).mean(axis=0, dtype=np.float32)
        scale = from_board(picture, board, stand_off_mm=self.draft.config.scale.stand_off_mm)
        self._told["remarks"] = [printable(remark) for remark in scale.remarks]
        return scale

    def scaled(self) -> None:
        """The scale has been taken another way: what was said of a board is old."""
        self._told["remarks"] = []

    def place_gauges(self) -> None:
        """Gauges on the region as it is drawn; raises DataError or ConfigError where there is no room."""
        drawn, config = self.drawn, self.draft.config
        if drawn is None or drawn.box is None:
            raise DataError("no region is drawn yet: draw one, or find the specimen")
        height, width = drawn.mask.shape
        box = replace(config, measure=replace(config.measure, roi=drawn.box, mask=None))
        placed = auto_gauges(grid_for(box, width, height, drawn.mask), config.specimen.first_axis)
        gauges = {f"gauges.{name}": table for name, table in placed.items()}
        self.draft.change_all(gauges | {"measure.gauges": GIVEN})

    def save(self) -> None:
        """Write the rig file, with the region as it is drawn; raises ConfigError where that cannot be."""
        drawn = self.drawn
        if drawn is None or drawn.box is None:
            self.draft.save(None)
            return
        self.draft.change_all({"measure.roi": list(drawn.box), "measure.mask": None})
        self.draft.save(None if drawn.is_box else drawn.mask)

    def mask_picture(self) -> bytes:
        """What is measured, as a picture to lay over: dark where it is not."""
        drawn = self.drawn
        mask = np.ones((1, 1), bool) if drawn is None else drawn.mask
        shade = np.zeros((*mask.shape, 4), np.uint8)
        shade[~mask] = SHADE
        return as_png(shade)

    def config(self, folder: Path) -> Config:
        """The configuration with the region as it is drawn; a mask that is no box is written into ``folder``.

        Raises
        ------
        DataError, ConfigError
            Nothing is drawn, or no ZOI or gauge fits into it.
        """
        drawn, config = self.drawn, self.draft.config
        if drawn is None or drawn.box is None:
            raise DataError("no region is drawn yet: draw one, or find the specimen")
        path = None
        if not drawn.is_box:
            path = folder / f"mask-{time.monotonic_ns()}.png"
            write_picture(path, drawn.mask.astype(np.uint8) * 255)
        region = replace(config.measure, roi=drawn.box, mask=None if path is None else str(path))
        return replace(config, measure=region)

    def ready(self, folder: Path) -> Config:
        """As ``config``, for a test: raises ConfigError too where no ZOI or gauge lies in the region."""
        config = self.config(folder)
        assert self.drawn is not None
        height, width = self.drawn.mask.shape
        grid = grid_for(config, width, height, self.drawn.mask)
        if not grid.n_active:
            raise DataError("no ZOI lies in the region: draw a larger one, or take smaller ZOIs")
        gauges_for(config.gauges, config.specimen.first_axis, grid)
        return config

    def state(self) -> dict[str, Any]:
        """All that the page shows of it."""
        info, config, drawn = self.preview.info, self.draft.config, self.drawn
        m, specimen = config.measure, config.specimen
        return {
            **self._told,
            "trouble": self.preview.trouble,
            "camera": None if info is None else camera_values(info),
            "picture": self._shown,
            "overlays": self.overlays,
            "region": None
            if drawn is None
            else {"words": drawn.words, "box": drawn.box, "edition": self._edition},
            "gauges": gauges_of(config),
            "measure": {"zoi": m.zoi, "step": m.step, "burst": m.burst or DEFAULT_BURST},
            "specimen": {key: getattr(specimen, key) for key in ("width_mm", "thickness_mm", "axis")},
            "metadata": dict(config.metadata),
            "scale": {"px_per_mm": config.scale.px_per_mm, "sigma": config.scale.sigma_mm_per_px},
            "unsaved": sorted(self.draft.changes),
            "file": str(self.draft.path),
        }

    # -- the camera ---------------------------------------------------------------------------

    def _opened(self, info: CameraInfo) -> None:
        self._told["checking"] = False
        with self._lock:
            if self.drawn is not None and self.drawn.mask.shape != (info.height, info.width):
                self.drawn = None

    def _show(self, frame: Frame) -> float:
        """Draw, where somebody looks; when to draw again."""
        began = time.monotonic()
        if self._broadcaster.watched:
            picture, scale = shrunk(frame.image, frame.bits)
            figures = self._figures
            if self.overlays["quality"] and figures is not None:
                lay_cells(picture, scale, figures.zois.grid, quality(figures))
            if self.overlays["saturated"]:
                mark_saturated(picture, scale, frame.image, frame.bits)
            self.picture = as_jpeg(picture)
            self._shown += 1
        self.refresh()
        return max(began + PICTURE_S, time.monotonic() + 2 * (time.monotonic() - began))

    # -- the judgement ------------------------------------------------------------------------

    def _work(self) -> None:
        lower_priority(OUTPUT)
        while not self._leave.is_set():
            try:
                self._judge()
            except PhasedicError as error:
                self._told |= {"doubt": printable(brief(error)), "checking": False}
            except Exception as error:
                log.exception("judging the specimen failed")
                self._told |= {"doubt": f"a defect: {error!r}", "checking": False}
            self.refresh()
            self._leave.wait(JUDGE_S)

    def _judge(self) -> None:
        info, frames = self.preview.info, self.preview.recent()
        if info is None or len(frames) < RECENT or self.preview.collecting:
            return  # frames that a check needs must not be lost for want of processor time
        self._compile(info)
        if self.drawn is None:
            self._begin(info)
            if self.draft.config.measure.gauges == AUTO:
                self.place_gauges()
        collected = self.preview.collected()
        if collected is not None:
            self._check(collected, info)
        else:
            self._glance(frames, info)

    def _glance(self, frames: list[Frame], info: CameraInfo) -> None:
        """What changes while lens and light are turned; what takes the kernel, in turns."""
        edition, config = self._edition, self.config(Path(self._folder.name))
        if self._watched != (edition, config, info):
            self._watched, self._watch = (edition, config, info), QuickChecker(config)
        self._note(self._watch.glance(shots_of(frames, info)).figures)

    def _compile(self, info: CameraInfo) -> None:
        """By processes of their own: the test that follows must not measure with what this one has compiled."""

        def tell(text: str) -> None:
            self._told["busy"] = text
            self.refresh()

        phase = self.draft.config.measure.estimator == "phase"
        compile_ahead(picture_kinds(info), phase=phase, say=tell, stopped=self._leave.is_set)
        self._told["busy"] = ""

    def _begin(self, info: CameraInfo) -> None:
        """The region as the rig has it, or the specimen that is found."""
        m = self.draft.config.measure
        if not isinstance(m.roi, tuple) and m.mask is None:
            self.find()
            return
        region = region_of(self.draft.config, np.zeros((info.height, info.width), np.float32))
        given = read_mask(m.mask, info.width, info.height)
        inside = region.inside(info.width, info.height, m.zoi)
        self._take(DrawnRegion(inside if given is None else inside & given, region.words))

    def _take(self, found: DrawnRegion) -> None:
        with self._lock:
            if self.drawn is None:
                self.drawn = found
            else:
                self.drawn.take(found.mask, found.words)
        self.region_changed()

    def _enough(self) -> int:
        info = self.preview.info
        if info is None:
            raise DataError("the camera has given no picture yet")
        wanted = 2 * (self.draft.config.measure.reference_burst or DEFAULT_REFERENCE_BURST)
        return max(min(wanted, MOST_BYTES // (2 * info.width * info.height)), RECENT)

    def _note(self, figures: CheckFigures) -> None:
        sharpness = figures.sharpness
        self._figures = figures
        self._peak = max(self._peak, sharpness if np.isfinite(sharpness) else 0.0)
        self._told |= figure_values(figures) | {"peak": self._peak, "doubt": ""}

    def _check(self, frames: list[Frame], info: CameraInfo) -> None:
        folder, edition = Path(self._folder.name), self._edition
        config = self.config(folder)
        figures = examine(shots_of(frames, info), config)
        lines = [*judge(figures, None, config.measure.reference_shift_px), self._fitting(folder)]
        self._note(figures)
        self._told["checking"] = False
        if edition == self._edition:  # else the region has been changed meanwhile
            go = all(line.good for line in lines)
            self._told |= {
                "lines": [line_values(line) for line in lines],
                "go": go,
                "table": table_values(figures),
            }

    def _fitting(self, folder: Path) -> CheckLine:
        """Whether every gauge lies on ZOIs."""
        try:
            names = ", ".join(self.ready(folder).gauges)
        except PhasedicError as error:
            return CheckLine("gauges", str(error), False, "move it onto the region")
        return CheckLine("gauges", names or "none: the mean strain is reported")
