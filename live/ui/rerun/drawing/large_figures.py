"""Paints the large figures, readable from two metres; red while an alarm is active."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquire.cv2_loader import load_cv2
from acquire.printable import share_text
from live.pipeline.snapshot import Snapshot
from live.ui.rerun.drawing.shapes import BACKGROUND

WIDTH, HEIGHT = 1600, 168
"""px of the picture; the digits are nearly half of the height."""

Colour = tuple[int, int, int]  # blue, green, red
WHITE, GREY, RED, GREEN, AMBER = (
    (245, 240, 235),
    (170, 160, 150),
    (40, 30, 200),
    (110, 220, 90),
    (60, 190, 255),
)
_CELLS = ((14, 370), (400, 506), (920, 346), (1280, 306))  # left edge and width
_LABEL_Y, _VALUE_Y, _LINE_Y = 28, 116, 157  # base lines
_STATES = {"REC": RED, "ARMED": AMBER, "NOT RECORDING": AMBER, "REPLAY": GREY}


def paint(snapshot: Snapshot) -> NDArray[np.uint8]:
    """(HEIGHT, WIDTH, 3) uint8, blue, green, red."""
    alarmed = bool(snapshot.alarms)
    picture = np.empty((HEIGHT, WIDTH, 3), np.uint8)
    picture[:] = RED if alarmed else BACKGROUND[::-1]
    labels = WHITE if alarmed else GREY
    for (x, width), (label, value, colour) in zip(_CELLS, _cells(snapshot), strict=True):
        _write(picture, label, (x, _LABEL_Y), 24, width, labels)
        _write(picture, value, (x, _VALUE_Y), 76, width, WHITE if alarmed else colour)
    _write(picture, _line(snapshot), (14, _LINE_Y), 29, WIDTH - 28, labels)
    return picture


def _cells(s: Snapshot) -> tuple[tuple[str, str, Colour], ...]:
    sigma = "" if math.isnan(s.sigma_axial) else f"+- {s.sigma_axial * 1e6:.0f} "
    state = s.state.partition(",")[0]
    return (
        ("STATE", "PAUSED" if "PAUSED" in s.state else state, _STATES.get(state, GREEN)),
        (f"STRAIN {sigma}um/m", _number(s.axial * 1e6, "+,.0f"), WHITE),
        ("FORCE kN" if abs(s.force_N) >= 1e4 else "FORCE N", _force(s.force_N), WHITE),
        ("STRESS MPa", _number(s.stress_Pa * 1e-6, ".1f"), WHITE),
    )


def _force(value: float) -> str:
    return _number(value, ".1f") if not abs(value) >= 1e4 else _number(value / 1e3, ".3f")


def _number(value: float, form: str) -> str:
    return "-" if math.isnan(value) else format(value, form).replace(",", " ")


def _line(s: Snapshot) -> str:
    if s.alarms:
        return "ALARM  " + "   ".join(s.alarms)
    if not s.zois:
        return "nothing measured yet"
    lost = s.zois - s.valid
    part = share_text(s.area_share)
    words = f"{s.valid} of {s.zois} ZOIs" + (f", {lost} LOST" if lost else "")
    return f"{words}; strain {part}" if part else words


def _write(
    picture: NDArray[Any], text: str, at: tuple[int, int], height: int, width: int, colour: Colour
) -> None:
    """Write text of ``height`` px on a base line, smaller where it would be wider than ``width``."""
    cv2 = load_cv2()
    font, thick = cv2.FONT_HERSHEY_SIMPLEX, max(2, height // 12)
    text = text.replace("µ", "u").encode("ascii", "replace").decode()
    scale = cv2.getFontScaleFromHeight(font, height, thick)
    (wide, _), _ = cv2.getTextSize(text, font, scale, thick)
    if wide > width:
        scale, thick = scale * width / wide, max(2, int(thick * width / wide))
    cv2.putText(picture, text, at, font, scale, colour, thick, cv2.LINE_AA)
