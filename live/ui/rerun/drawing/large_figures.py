"""Paints the large figures, readable from two metres; red while an alarm is active."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquire.cv2_loader import drawn_letters, load_cv2
from live.ui.rerun.messages import LargeFigures

WIDTH, HEIGHT = 1600, 168
"""px of the picture; the digits are nearly half of the height."""

Colour = tuple[int, int, int]  # blue, green, red
WHITE, GREY, RED, GREEN, AMBER, BAR = (
    (248, 246, 244),
    (167, 157, 147),
    (30, 38, 179),
    (124, 207, 62),
    (61, 184, 245),
    (36, 29, 23),
)
_LABELS = (204, 195, 185)
_CELLS = ((14, 370), (400, 506), (920, 346), (1280, 306))  # left edge and width
_LABEL_Y, _VALUE_Y, _LINE_Y = 28, 116, 157  # base lines
_BEYOND = (106, 110, 255)  # red on the dark ground
_INKS = {
    "live": WHITE, "old": GREY, "beyond": _BEYOND,
    "REC": _BEYOND, "ARMED": AMBER, "NOT RECORDING": AMBER, "REPLAY": GREY, "PAUSED": AMBER,
}  # fmt: skip
"""Of a tone; other states are green."""


def paint(shown: LargeFigures) -> NDArray[np.uint8]:
    """(HEIGHT, WIDTH, 3) uint8, blue, green, red."""
    alarmed = shown.alarmed
    picture = np.empty((HEIGHT, WIDTH, 3), np.uint8)
    picture[:] = RED if alarmed else BAR
    labels = WHITE if alarmed else _LABELS
    for (x, width), (label, value, tone) in zip(_CELLS, shown.cells, strict=False):
        _write(picture, label, (x, _LABEL_Y), 24, width, labels)
        is_thin = tone in ("old", "REPLAY") and value != "-"
        ink = (_LABELS if is_thin else WHITE) if alarmed else _INKS.get(tone, GREEN)
        _write(picture, value, (x, _VALUE_Y), 76, width, ink, is_thin=is_thin)
    _write(picture, shown.line, (14, _LINE_Y), 29, WIDTH - 28, labels)
    return picture


def _write(
    picture: NDArray[Any],
    text: str,
    at: tuple[int, int],
    height: int,
    width: int,
    colour: Colour,
    *,
    is_thin: bool = False,
) -> None:
    """Write text of ``height`` px on a base line, smaller where it would be wider than ``width``."""
    cv2 = load_cv2()
    font, thick = cv2.FONT_HERSHEY_SIMPLEX, 1 if is_thin else max(2, height // 12)
    text = drawn_letters(text)
    scale = cv2.getFontScaleFromHeight(font, height, thick)
    (wide, _), _ = cv2.getTextSize(text, font, scale, thick)
    if wide > width:
        scale, thick = scale * width / wide, 1 if is_thin else max(2, int(thick * width / wide))
    cv2.putText(picture, text, at, font, scale, colour, thick, cv2.LINE_AA)
