"""Set-up before a test: the live picture, the region drawn on it, and the check of the still specimen.

The thread of the camera (``preview``) draws a few pictures a second; another thread checks the newest frames
(``live.setup.check``).
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
from numpy.typing import NDArray

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
from live.results.maps.painting import overlay_cells
from live.setup.check.check_list import CheckFigures, examine
from live.setup.check.quick_check import QuickChecker
from live.setup.check.verdict import CheckLine, check_lines
from live.setup.compiling import compile_ahead
from live.setup.grid import grid_for
from live.setup.pictures import read_mask
from live.setup.placement import auto_gauges
from live.setup.region import region_of
from live.setup.scale import Board, Scale, from_board
from live.ui.web.broadcaster import Broadcaster
from live.ui.web.camera_preview import RECENT, CameraPreview
from live.ui.web.check_panel import (
    camera_values,
    figure_values,
    frame_stack,
    line_values,
    quality_colours,
    table_values,
)
from live.ui.web.config_draft import ConfigDraft
from live.ui.web.drawn_region import DrawnRegion
from live.ui.web.page_consumer import gauge_shapes
from live.ui.web.painting import as_jpeg, as_png, mark_saturated, shrunk

log = logging.getLogger(__name__)

PICTURE_S, EVALUATE_S = 0.2, 0.4
MAX_BYTES = 400_000_000  # of the frames of a check
OVERLAYS = ("saturated", "quality")
SHADE = (60, 20, 0, 150)
"""Colour over pixels that are not measured: blue, green, red, opacity."""


class SetupSession:
    """The set-up of a rig; reads the camera from ``with`` to its end.

    Parameters
    ----------
    draft : ConfigDraft
    broadcaster : Broadcaster
        Gets the state for the pages.
    drawn : DrawnRegion, optional
        The region of the last specimen.

    Attributes
    ----------
    picture : bytes
        The newest picture with its overlays, as JPEG.
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
        self._checker, self._checked_for = QuickChecker(draft.config), tuple[Any, ...]()
        self._values: dict[str, Any] = {"table": None, "go": None, "lines": [], "checking": False}
        self._values |= {"doubt": "", "busy": "", "remarks": []}
        self._peak, self._shown, self._edition = 0.0, 0, 0
        self._lock = threading.RLock()
        self._closing = threading.Event()
        self._folder = TemporaryDirectory(prefix="phasedic-")
        self._evaluating = threading.Thread(target=self._work, name="page-check", daemon=True)

    def __enter__(self) -> SetupSession:
        self.preview.start()
        self._evaluating.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._closing.set()
        self.preview.close()
        self._evaluating.join()
        self._folder.cleanup()

    # -- requests of the page -----------------------------------------------------------------

    def refresh(self) -> None:
        """Send the state to the pages."""
        self._broadcaster.publish("setup", self.state())

    def check(self) -> None:
        """Collect as many frames as ``phasedic check`` does, and run the whole check on them."""
        self.preview.collect(self._frames_needed())
        self._values |= {"checking": True, "go": None}

    def reset_peak(self) -> None:
        """Reset the peak hold of the sharpness."""
        self._peak = 0.0

    def region_changed(self) -> None:
        """Discard the results of the former region."""
        with self._lock:
            self._edition += 1
            self._values |= {"table": None, "go": None, "lines": []}

    def find(self) -> None:
        """Find the specimen in the last frames; raises DataError where there is no picture or no specimen."""
        info, stack = self._camera(), self._recent_stack()
        noise = float(np.diff(stack, axis=0).std()) / 2**0.5 / len(stack) ** 0.5 if len(stack) > 1 else None
        m = self.draft.config.measure
        automatic = replace(self.draft.config, measure=replace(m, roi=None, mask=None))
        region = region_of(automatic, stack.mean(axis=0), noise or None)
        self._set_region(DrawnRegion(region.inside(info.width, info.height, m.zoi), region.words))

    def scale_from(self, board: Board) -> Scale:
        """The scale from a board in the last frames; raises DataError where there is none."""
        picture = self._recent_stack().mean(axis=0)
        scale = from_board(picture, board, stand_off_mm=self.draft.config.scale.stand_off_mm)
        self._values["remarks"] = [printable(remark) for remark in scale.remarks]
        return scale

    def clear_remarks(self) -> None:
        """Remove the remarks on a calibration board: the scale was taken another way."""
        self._values["remarks"] = []

    def place_gauges(self) -> None:
        """Place gauges on the drawn region; raises DataError or ConfigError where they do not fit."""
        (drawn, roi), config = self._region(), self.draft.config
        height, width = drawn.mask.shape
        box = replace(config, measure=replace(config.measure, roi=roi, mask=None))
        placed = auto_gauges(grid_for(box, width, height, drawn.mask), config.specimen.first_axis)
        gauges = {f"gauges.{name}": table for name, table in placed.items()}
        self.draft.change_all(gauges | {"measure.gauges": GIVEN})

    def save(self) -> None:
        """Write the rig file with the drawn region; raises ConfigError where a file cannot be written."""
        drawn = self.drawn
        if drawn is None or drawn.box is None:
            self.draft.save(None)
            return
        self.draft.change_all({"measure.roi": list(drawn.box), "measure.mask": None})
        self.draft.save(None if drawn.is_box else drawn.mask)

    def mask_picture(self) -> bytes:
        """An overlay that darkens the pixels that are not measured, as PNG."""
        drawn = self.drawn
        mask = np.ones((1, 1), bool) if drawn is None else drawn.mask
        shade = np.zeros((*mask.shape, 4), np.uint8)
        shade[~mask] = SHADE
        return as_png(shade)

    def config(self, folder: Path) -> Config:
        """The configuration with the drawn region; a mask that is not a rectangle is written into ``folder``.

        Raises
        ------
        DataError, ConfigError
            No region is drawn, or no ZOI or gauge fits into it.
        """
        (drawn, roi), config = self._region(), self.draft.config
        path = None
        if not drawn.is_box:
            path = folder / f"mask-{time.monotonic_ns()}.png"
            write_picture(path, drawn.mask.astype(np.uint8) * 255)
        region = replace(config.measure, roi=roi, mask=None if path is None else str(path))
        return replace(config, measure=region)

    def ready(self, folder: Path) -> Config:
        """As ``config``, for a test: also raises where no ZOI, or not every gauge, lies in the region."""
        config = self.config(folder)
        assert self.drawn is not None
        height, width = self.drawn.mask.shape
        grid = grid_for(config, width, height, self.drawn.mask)
        if not grid.n_active:
            raise DataError("no ZOI lies in the region: draw a larger one, or take smaller ZOIs")
        gauges_for(config.gauges, config.specimen.first_axis, grid)
        return config

    def state(self) -> dict[str, Any]:
        """The state of the set-up, as the page shows it."""
        info, config, drawn = self.preview.info, self.draft.config, self.drawn
        m, specimen = config.measure, config.specimen
        region = drawn and {"words": drawn.origin, "box": drawn.box, "edition": self._edition}
        return {
            **self._values,
            "trouble": self.preview.trouble,
            "camera": None if info is None else camera_values(info),
            "picture": self._shown,
            "overlays": self.overlays,
            "region": region,
            "gauges": gauge_shapes(config),
            "measure": {"zoi": m.zoi, "step": m.step, "burst": m.burst or DEFAULT_BURST},
            "specimen": {key: getattr(specimen, key) for key in ("width_mm", "thickness_mm", "axis")},
            "metadata": dict(config.metadata),
            "scale": {"px_per_mm": config.scale.px_per_mm, "sigma": config.scale.sigma_mm_per_px},
            "unsaved": sorted(self.draft.changes),
            "file": str(self.draft.path),
        }

    # -- the camera ---------------------------------------------------------------------------

    def _camera(self) -> CameraInfo:
        info = self.preview.info
        if info is None:
            raise DataError("the camera has given no picture yet")
        return info

    def _recent_stack(self) -> NDArray[np.float32]:
        """(N, H, W), the last frames."""
        frames = self.preview.recent()
        if not frames:
            raise DataError("the camera has given no picture yet")
        return np.stack([frame.image for frame in frames]).astype(np.float32)

    def _region(self) -> tuple[DrawnRegion, tuple[int, int, int, int]]:
        """The drawn region and its box."""
        drawn = self.drawn
        if drawn is None or drawn.box is None:
            raise DataError("no region is drawn yet: draw one, or find the specimen")
        return drawn, drawn.box

    def _opened(self, info: CameraInfo) -> None:
        self._values["checking"] = False
        with self._lock:
            if self.drawn is not None and self.drawn.mask.shape != (info.height, info.width):
                self.drawn = None

    def _show(self, frame: Frame) -> float:
        """Draw the picture while a page is open; when to draw again."""
        began = time.monotonic()
        if self._broadcaster.open_pages:
            picture, scale = shrunk(frame.image, frame.bits)
            figures = self._figures
            if self.overlays["quality"] and figures is not None:
                overlay_cells(picture, scale, figures.zois.grid, quality_colours(figures))
            if self.overlays["saturated"]:
                mark_saturated(picture, scale, frame.image, frame.saturation)
            self.picture = as_jpeg(picture)
            self._shown += 1
        self.refresh()
        return max(began + PICTURE_S, time.monotonic() + 2 * (time.monotonic() - began))

    # -- the check ----------------------------------------------------------------------------

    def _work(self) -> None:
        lower_priority(OUTPUT)
        while not self._closing.is_set():
            try:
                self._evaluate()
            except PhasedicError as error:
                self._values |= {"doubt": printable(brief(error)), "checking": False}
            except Exception as error:
                log.exception("the check of the specimen failed")
                self._values |= {"doubt": f"a defect: {error!r}", "checking": False}
            self.refresh()
            self._closing.wait(EVALUATE_S)

    def _evaluate(self) -> None:
        info, frames = self.preview.info, self.preview.recent()
        if info is None or len(frames) < RECENT or self.preview.collecting:
            return  # a busy processor must not lose frames of a check
        self._compile(info)
        if self.drawn is None:
            self._begin(info)
            if self.draft.config.measure.gauges == AUTO:
                self.place_gauges()
        collected = self.preview.collected()
        if collected is not None:
            self._check(collected, info)
        else:
            self._quick_check(frames, info)

    def _quick_check(self, frames: list[Frame], info: CameraInfo) -> None:
        """Update the figures that change while lens and light are adjusted."""
        edition, config = self._edition, self.config(Path(self._folder.name))
        if self._checked_for != (edition, config, info):
            self._checked_for, self._checker = (edition, config, info), QuickChecker(config)
        self._keep_figures(self._checker.check(frame_stack(frames, info)).figures)

    def _compile(self, info: CameraInfo) -> None:
        """Compile in separate processes: the test that follows must load the kernel from its cache."""

        def report(text: str) -> None:
            self._values["busy"] = text
            self.refresh()

        phase = self.draft.config.measure.estimator == "phase"
        compile_ahead(picture_kinds(info), phase=phase, say=report, stopped=self._closing.is_set)
        self._values["busy"] = ""

    def _begin(self, info: CameraInfo) -> None:
        """Begin with the region of the rig file, or with the specimen that is found."""
        m = self.draft.config.measure
        if not isinstance(m.roi, tuple) and m.mask is None:
            self.find()
            return
        region = region_of(self.draft.config, np.zeros((info.height, info.width), np.float32))
        given = read_mask(m.mask, info.width, info.height)
        inside = region.inside(info.width, info.height, m.zoi)
        self._set_region(DrawnRegion(inside if given is None else inside & given, region.words))

    def _set_region(self, found: DrawnRegion) -> None:
        with self._lock:
            if self.drawn is None:
                self.drawn = found
            else:
                self.drawn.replace(found.mask, found.origin)
        self.region_changed()

    def _frames_needed(self) -> int:
        info = self._camera()
        wanted = 2 * (self.draft.config.measure.reference_burst or DEFAULT_REFERENCE_BURST)
        return max(min(wanted, MAX_BYTES // (2 * info.width * info.height)), RECENT)

    def _keep_figures(self, figures: CheckFigures) -> None:
        sharpness = figures.sharpness
        self._figures = figures
        self._peak = max(self._peak, sharpness if np.isfinite(sharpness) else 0.0)
        self._values |= figure_values(figures) | {"peak": self._peak, "doubt": ""}

    def _check(self, frames: list[Frame], info: CameraInfo) -> None:
        folder, edition = Path(self._folder.name), self._edition
        config = self.config(folder)
        figures = examine(frame_stack(frames, info), config)
        lines = [*check_lines(figures, None, config.measure.reference_shift_px), self._gauge_line(folder)]
        self._keep_figures(figures)
        self._values["checking"] = False
        if edition == self._edition:  # else the region has changed meanwhile
            go = all(line.good for line in lines)
            self._values |= {
                "lines": [line_values(line) for line in lines],
                "go": go,
                "table": table_values(figures),
            }

    def _gauge_line(self, folder: Path) -> CheckLine:
        """Whether every gauge lies on ZOIs."""
        try:
            names = ", ".join(self.ready(folder).gauges)
        except PhasedicError as error:
            return CheckLine("gauges", str(error), False, "move it onto the region")
        return CheckLine("gauges", names or "none: the mean strain is reported")
