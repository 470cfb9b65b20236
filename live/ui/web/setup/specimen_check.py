"""The check of the still specimen during set-up: a thread judges the newest frames; the whole check on request.

What the page gets of it are plain values and colours.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquire.errors import PhasedicError
from acquire.frame import CameraInfo, Frame
from acquire.system import lower_priority
from acquire.text import Message
from acquire.text.message import brief, printable
from live.config.sections import DEFAULT_REFERENCE_BURST
from live.pipeline.consumer import Screen
from live.pipeline.latency import OUTPUT
from live.setup.check.check_list import CheckFigures, examine
from live.setup.check.lines import CheckLine, disk_lines, write_rate
from live.setup.check.quick_check import QuickChecker
from live.setup.check.sample import FrameStack
from live.setup.check.verdict import check_lines
from live.setup.compiling import compile_ahead
from live.setup.dry_run import picture_kinds
from live.ui.web.map_view import traffic_light
from live.ui.web.setup.camera_preview import MAX_BYTES, RECENT, CameraPreview
from live.ui.web.setup.config_draft import ConfigDraft
from live.ui.web.setup.load_preview import LoadPreview
from live.ui.web.setup.specimen_region import SpecimenRegion

GOOD, BAD = 50e-6, 1000e-6
"""Strain noise of a ZOI that is shown green, and that is shown red."""

log = logging.getLogger(__name__)

EVALUATE_S = 0.4
_NO_VERDICT: dict[str, Any] = {"table": None, "go": None, "lines": []}


def frame_stack(frames: Sequence[Frame], info: CameraInfo) -> FrameStack:
    """Consecutive frames as the input of the check."""
    lost = sum(frame.lost_before for frame in frames[1:])
    return FrameStack(np.stack([f.image for f in frames]), np.array([f.t for f in frames]), lost, info)


def quality_colours(figures: CheckFigures) -> NDArray[np.uint8]:
    """Colours of the ZOIs by their predicted strain noise; transparent outside the region."""
    cells = traffic_light(figures.zois.sigma, GOOD, BAD)
    cells[~figures.zois.grid.active] = 0
    return cells


def camera_values(info: CameraInfo) -> dict[str, Any]:
    """The camera, and its settings that can be changed."""
    return {
        "name": printable(info.name),
        "width": info.width,
        "height": info.height,
        "bits": info.bits,
        "fps": info.fps,
        "format": printable(info.pixel_format),
        "formats": [printable(name) for name in info.formats],
        "rates": info.rates,
        "sliders": [asdict(setting) for setting in info.settings],
        "warnings": [printable(text) for text in info.warnings],
    }


def line_values(line: CheckLine) -> dict[str, Any]:
    """A line of the check."""
    return {
        "what": line.what,
        "value": printable(line.value),
        "good": line.good,
        "advice": printable(line.advice),
        "measured": line.measured,
    }


def table_values(figures: CheckFigures) -> dict[str, Any]:
    """The strain noise of one ZOI by its size and the burst, at the order of the test."""
    bursts = sorted({noise.burst for floor in figures.floors for noise in floor.noises})
    rows = [
        {
            "zoi": floor.zoi,
            "order": floor.order,
            "vsg": floor.vsg,
            "l10": floor.l10,
            "noise": [None if (noise := floor.of(n)) is None else noise.known for n in bursts],
        }
        for floor in figures.floors
        if floor.order == figures.order
    ]
    return {"bursts": bursts, "rows": rows, "zoi": figures.zoi, "burst": figures.burst}


def figure_values(figures: CheckFigures) -> dict[str, Any]:
    """The figures that change while lens and light are adjusted."""
    sigma = figures.zois.sigma[np.isfinite(figures.zois.sigma)]
    return {
        "sharpness": figures.sharpness,
        "saturated": figures.exposure.saturated,
        "light": figures.exposure.high,
        "noise_GL": figures.noise,
        "sigma": float(np.median(sigma)) if sigma.size else None,
        "zois": figures.zois.grid.n_active,
    }


def recent_stack(frames: list[Frame]) -> NDArray[np.float32]:
    """(N, H, W)."""
    return np.stack([frame.image for frame in frames]).astype(np.float32)


class SpecimenCheck(Screen):
    """Checks the specimen until it is closed.

    Parameters
    ----------
    draft : ConfigDraft
    preview : CameraPreview
    load : LoadPreview or None
        None: another camera of the test has it.
    region : SpecimenRegion
    folder : Path
        For masks.
    refresh : callable
        Called when ``values`` have changed.

    Attributes
    ----------
    values : dict
        For the page: the verdict ``go``, its ``lines`` and ``table``, the figures, and what is being done.
    figures : CheckFigures or None
        The newest.
    """

    def __init__(
        self,
        draft: ConfigDraft,
        preview: CameraPreview,
        load: LoadPreview | None,
        region: SpecimenRegion,
        folder: Path,
        refresh: Callable[[], None],
    ) -> None:
        self._draft, self._preview, self._load, self._region = draft, preview, load, region
        self._folder, self._refresh = folder, refresh
        self.values: dict[str, Any] = {**_NO_VERDICT, "checking": False, "doubt": "", "busy": ""}
        self.figures: CheckFigures | None = None
        self._checker, self._checked_for = QuickChecker(draft.config), tuple[Any, ...]()
        self._peak = 0.0
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._work, name="page-check", daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def close(self) -> None:
        """End the thread."""
        self._closing.set()
        self._thread.join()

    def begin(self) -> None:
        """Run the whole check on the next frames; raises DataError where there is no camera."""
        self._preview.collect()
        self.values |= {"checking": True, "go": None}

    def discard(self) -> None:
        """Discard the verdict: it holds for another region, rig or camera."""
        self.values |= _NO_VERDICT

    def reset_peak(self) -> None:
        """Reset the peak hold of the sharpness."""
        self._peak = 0.0

    def frames_needed(self, info: CameraInfo) -> int:
        """Frames of a whole check."""
        wanted = 2 * (self._draft.config.measure.reference_burst or DEFAULT_REFERENCE_BURST)
        return max(min(wanted, MAX_BYTES // (2 * info.width * info.height)), RECENT)

    def _work(self) -> None:
        lower_priority(OUTPUT)
        while not self._closing.is_set():
            try:
                self._evaluate()
            except PhasedicError as error:
                self._failed(printable(brief(error)))
            except Exception as error:
                log.exception("the check of the specimen failed")
                self._failed(Message("a defect: {error}", repr(error)))
            self._refresh()
            self._closing.wait(EVALUATE_S)

    def status(self, text: str) -> None:
        """Show what is being done, as the status line of a terminal does."""
        self.values["busy"] = text
        self._refresh()

    def _failed(self, why: str) -> None:
        """A whole check that fails gives a verdict too: NO-GO, with the reason."""
        if self.values["checking"]:
            line = CheckLine("check", why, False, "mend this, then check again")
            self.values |= {"go": False, "lines": [line_values(line)], "table": None}
        self.values |= {"doubt": why, "checking": False}

    def _evaluate(self) -> None:
        info, frames = self._preview.info, self._preview.recent()
        if info is None or not frames or self._preview.collecting:
            return  # a busy processor must not lose frames of a check
        self._compile(info)
        if self._region.drawn is None:
            self._region.begin(info, recent_stack(frames))
        collected = self._preview.collected()
        if collected is not None:
            self._check(collected, info)
        else:
            # Update the figures that change while lens and light are adjusted.
            now = (self._region.edition, self._draft.config, info)
            if self._checked_for != now:
                self._checked_for = now
                self._checker = QuickChecker(self._region.config(self._folder))
            self._keep_figures(self._checker.check(frame_stack(frames, info)).figures)

    def _compile(self, info: CameraInfo) -> None:
        """Compile in separate processes: the test that follows must load the kernel from its cache."""
        phase = self._draft.config.measure.estimator == "phase"
        compile_ahead(picture_kinds(info), phase=phase, screen=self, stopping=self._closing)
        self.values["busy"] = ""

    def _keep_figures(self, figures: CheckFigures) -> None:
        sharpness = figures.sharpness
        self.figures = figures
        self._peak = max(self._peak, sharpness if np.isfinite(sharpness) else 0.0)
        self.values |= figure_values(figures) | {"peak": self._peak, "doubt": ""}

    def _check(self, frames: list[Frame], info: CameraInfo) -> None:
        edition, config = self._region.edition, self._region.config(self._folder)
        load = None if self._load is None else self._load.report()
        stack = frame_stack(frames, info)
        figures = examine(stack, config, load)
        shift = config.measure.reference_shift_px
        of_load = () if self._load is None else self._load.lines(load)
        disk = disk_lines(write_rate(stack, config), config)
        lines = [*check_lines(figures, None, shift), *disk, *of_load, self._gauge_line()]
        self._keep_figures(figures)
        self.values["checking"] = False
        if edition == self._region.edition:  # else the region has changed meanwhile
            go = all(line.good for line in lines)
            shown = [line_values(line) for line in lines]
            self.values |= {"lines": shown, "go": go, "table": table_values(figures)}

    def _gauge_line(self) -> CheckLine:
        """Whether every gauge lies on ZOIs."""
        try:
            names = ", ".join(self._region.ready(self._folder).gauges)
        except PhasedicError as error:
            return CheckLine("gauges", error.text, False, "move it onto the region")
        return CheckLine(
            "gauges",
            Message("placed: {names}", names)
            if names
            else Message("none: the strain of the region is reported"),
        )
