"""Paints the large figures, readable from two metres; red while an alarm is active."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquire.cv2_loader import load_cv2
from acquire.text.quantity import GAP, IN_ASCII, PLUS_MINUS, Amount
from live.pipeline.timed.figure import BEYOND, LACKING, FigureState, TimedFigure
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
_STATES = {"REC": _BEYOND, "ARMED": AMBER, "NOT RECORDING": AMBER, "REPLAY": GREY, "PAUSED": AMBER}


def paint(shown: LargeFigures) -> NDArray[np.uint8]:
    """(HEIGHT, WIDTH, 3) uint8, blue, green, red."""
    alarmed = shown.alarmed
    picture = np.empty((HEIGHT, WIDTH, 3), np.uint8)
    picture[:] = RED if alarmed else BAR
    labels = WHITE if alarmed else _LABELS
    for (x, width), (label, value, colour) in zip(_CELLS, _cells(shown), strict=True):
        _write(picture, label, (x, _LABEL_Y), 24, width, labels)
        is_thin = colour == GREY and value != "-"
        ink = (_LABELS if is_thin else WHITE) if alarmed else colour
        _write(picture, value, (x, _VALUE_Y), 76, width, ink, is_thin=is_thin)
    _write(picture, shown.line, (14, _LINE_Y), 29, WIDTH - 28, labels)
    return picture


def _cells(shown: LargeFigures) -> list[tuple[str, str, Colour]]:
    state = ("STATE", shown.state, _STATES.get(shown.state, GREEN))
    return [state, *(_cell(*one) for one in shown.figures)]


def _cell(name: str, kind: str, figure: TimedFigure) -> tuple[str, str, Colour]:
    """Label and value; without a value what is there instead: the last one in grey, with its age in the label."""
    shown = Amount(kind, figure.last, figure.sigma).printed()
    if figure.known:
        sigma = f"{PLUS_MINUS} {shown.sigma} " if shown.sigma else ""
        return f"{name} {sigma}{shown.unit}", shown.value, WHITE
    if figure.state in BEYOND:
        return f"{name} {shown.unit}", figure.state.upper(), _BEYOND
    if figure.state in LACKING and figure.last == figure.last:
        last = Amount(kind, figure.last).printed()
        return f"{name} {last.unit}  {figure.age:.0f} s old", last.value, GREY
    label = f"{name} {shown.unit}"
    return label if figure.state is FigureState.NONE else f"{label}  {figure.state}", "-", GREY


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
    text = text.replace(GAP, " ").translate(IN_ASCII).encode("ascii", "replace").decode()
    scale = cv2.getFontScaleFromHeight(font, height, thick)
    (wide, _), _ = cv2.getTextSize(text, font, scale, thick)
    if wide > width:
        scale, thick = scale * width / wide, 1 if is_thin else max(2, int(thick * width / wide))
    cv2.putText(picture, text, at, font, scale, colour, thick, cv2.LINE_AA)
