"""The region of the specimen and its gauges during set-up: drawn, found or placed, undone, and saved."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquire.errors import ConfigError, DataError
from acquire.files.picture import write_picture
from acquire.frame import CameraInfo
from live.config.gauges import GaugeTable, gauges_for, with_colours
from live.config.loading import Config
from live.config.values import AUTO, GIVEN
from live.setup.grid import grid_for
from live.setup.pictures import read_mask
from live.setup.placement import auto_gauges
from live.setup.region import region_of
from live.ui.web.map_view import as_png
from live.ui.web.setup.config_draft import ConfigDraft
from live.ui.web.setup.drawn_region import MAX_UNDO, DrawnRegion

SHADE = (60, 20, 0, 150)
"""Colour over pixels that are not measured: blue, green, red, opacity."""


class SpecimenRegion:
    """The drawn region and the gauges of a draft, with one undo for both.

    Parameters
    ----------
    draft : ConfigDraft
    drawn : DrawnRegion or None
        The region of the last specimen.
    on_change : callable
        Called when the results of the former region no longer hold.

    Attributes
    ----------
    drawn : DrawnRegion or None
        None until there is a picture.
    edition : int
        Counts the changes.
    """

    def __init__(self, draft: ConfigDraft, drawn: DrawnRegion | None, on_change: Callable[[], None]) -> None:
        self._draft, self.drawn, self._on_change = draft, drawn, on_change
        self.edition = 0
        # What each edit has replaced: the gauges, or None for the mask, which ``drawn`` keeps.
        self._edits: deque[Mapping[str, GaugeTable] | None] = deque(maxlen=MAX_UNDO)
        self._undone: list[Mapping[str, GaugeTable] | None] = []

    def changed(self) -> None:
        """Discard the results of the former region."""
        self.edition += 1
        self._on_change()

    @property
    def known(self) -> DrawnRegion:
        """The drawn region; raises DataError before the first picture."""
        if self.drawn is None:
            raise DataError("the camera has given no picture yet")
        return self.drawn

    def opened(self, info: CameraInfo) -> None:
        """Forget the region where the picture has another size."""
        if self.drawn is not None and self.drawn.mask.shape != (info.height, info.width):
            self.drawn = None
            self._edits.clear()
            self._undone.clear()

    # -- edits ----------------------------------------------------------------------------------

    def draw(self, strokes: list[Mapping[str, Any]]) -> None:
        """Draw strokes; raises ConfigError where one is invalid."""
        self.known.draw(strokes)
        self._edited_mask()

    def replace(self, mask: NDArray[np.bool_], origin: str) -> None:
        """Replace the mask."""
        self.known.replace(mask, origin)
        self._edited_mask()

    def set_gauges(self, gauges: Mapping[str, GaugeTable], changes: Mapping[str, Any] | None = None) -> None:
        """Take these gauges in place of all, and ``changes`` of other keys; each keeps its colour.

        Raises ConfigError and changes nothing where one is invalid.
        """
        before = self._draft.config.gauges
        self._draft.replace_gauges(with_colours(gauges), changes or {})
        self._edits.append(before)
        self._undone.clear()

    @property
    def can(self) -> list[str]:
        """Which of "undo" and "redo" has something to do."""
        return ["undo"] * bool(self._edits) + ["redo"] * bool(self._undone)

    def undo(self) -> None:
        """Undo the last edit of the mask or of the gauges; raises ConfigError without one."""
        if not self._edits:
            raise ConfigError("there is nothing to undo")
        self._undone.append(self._turned(self._edits.pop()))

    def redo(self) -> None:
        """Make the edit that was undone last again; raises ConfigError without one."""
        if not self._undone:
            raise ConfigError("there is nothing to make again")
        self._edits.append(self._turned(self._undone.pop(), again=True))

    def _turned(
        self, gauges: Mapping[str, GaugeTable] | None, *, again: bool = False
    ) -> Mapping[str, GaugeTable] | None:
        """Take these gauges, or the mask before or after its last edit; what was there, in the same form."""
        if gauges is None:
            self.known.redo() if again else self.known.undo()
            self.changed()
            return None
        before = self._draft.config.gauges
        self._draft.replace_gauges(gauges)
        return before

    def _edited_mask(self) -> None:
        self._edits.append(None)
        self._undone.clear()
        self.changed()

    # -- found in the picture ---------------------------------------------------------------------

    def begin(self, info: CameraInfo, stack: NDArray[np.float32]) -> None:
        """Begin with the region of the rig file, or with the specimen that is found, and its automatic gauges.

        A page sees the region when its gauges are placed: an edit of the page comes after them. Raises as ``find``.
        """
        m = self._draft.config.measure
        if not isinstance(m.roi, tuple) and m.mask is None:
            drawn = self._found(info, stack)
        else:
            region = region_of(self._draft.config, np.zeros((info.height, info.width), np.float32))
            given = read_mask(m.mask, info.width, info.height)
            inside = region.inside(info.width, info.height, m.zoi)
            drawn = DrawnRegion(inside if given is None else inside & given, region.words)
        try:
            if m.gauges == AUTO:
                self._place_gauges_on(drawn)
        finally:
            self.drawn = drawn
            self.changed()

    def find(self, info: CameraInfo, stack: NDArray[np.float32]) -> None:
        """Find the specimen in the last frames, (N, H, W); raises DataError where there is none."""
        found = self._found(info, stack)
        self.replace(found.mask, found.origin)

    def _found(self, info: CameraInfo, stack: NDArray[np.float32]) -> DrawnRegion:
        noise = float(np.diff(stack, axis=0).std()) / 2**0.5 / len(stack) ** 0.5 if len(stack) > 1 else None
        m = self._draft.config.measure
        automatic = replace(self._draft.config, measure=replace(m, roi=None, mask=None))
        region = region_of(automatic, stack.mean(axis=0), noise or None)
        return DrawnRegion(region.inside(info.width, info.height, m.zoi), region.words)

    def place_gauges(self) -> None:
        """Place gauges on the drawn region; raises DataError or ConfigError where they do not fit."""
        self._place_gauges_on(self.drawn)

    def _place_gauges_on(self, region: DrawnRegion | None) -> None:
        (drawn, roi), config = _boxed(region), self._draft.config
        height, width = drawn.mask.shape
        box = replace(config, measure=replace(config.measure, roi=roi, mask=None))
        placed = auto_gauges(grid_for(box, width, height, drawn.mask), config.specimen.first_axis)
        known = config.gauges
        kept = {name: {"colour": known[name].get("colour")} for name in placed if name in known}
        tables = {name: {**kept.get(name, {}), **table} for name, table in placed.items()}
        self.set_gauges({**known, **tables}, {"measure.gauges": GIVEN})

    # -- for the check, the test and the rig file ---------------------------------------------------

    def config(self, folder: Path) -> Config:
        """The configuration with the drawn region; a mask that is not a rectangle is written into ``folder``.

        Raises
        ------
        DataError, ConfigError
            No region is drawn, or no ZOI or gauge fits into it.
        """
        (drawn, roi), config = _boxed(self.drawn), self._draft.config
        path = None
        if not drawn.is_box:
            path = folder / f"mask-{time.monotonic_ns()}.png"
            write_picture(path, drawn.mask.astype(np.uint8) * 255)
        region = replace(config.measure, roi=roi, mask=None if path is None else str(path))
        return replace(config, measure=region)

    def ready(self, folder: Path) -> Config:
        """As ``config``, for a test: also raises where no ZOI, or not every gauge, lies in the region."""
        config = self.config(folder)
        height, width = self.known.mask.shape
        grid = grid_for(config, width, height, self.known.mask)
        if not grid.n_active:
            raise DataError("no ZOI lies in the region: draw a larger one, or take smaller ZOIs")
        gauges_for(config.gauges, config.specimen.first_axis, grid)
        return config

    def save(self) -> None:
        """Write the rig file with the drawn region; raises ConfigError where a file cannot be written."""
        drawn = self.drawn
        if drawn is None or drawn.box is None:
            self._draft.save(None)
            return
        self._draft.change_all({"measure.roi": list(drawn.box), "measure.mask": None})
        self._draft.save(None if drawn.is_box else drawn.mask)

    def shade(self) -> bytes:
        """An overlay that darkens the pixels that are not measured, as PNG."""
        drawn = self.drawn
        mask = np.ones((1, 1), bool) if drawn is None else drawn.mask
        shade = np.zeros((*mask.shape, 4), np.uint8)
        shade[~mask] = SHADE
        return as_png(shade)


def _boxed(drawn: DrawnRegion | None) -> tuple[DrawnRegion, tuple[int, int, int, int]]:
    """A region and its box; raises DataError without one."""
    if drawn is None or drawn.box is None:
        raise DataError("no region is drawn yet: draw one, or find the specimen")
    return drawn, drawn.box
