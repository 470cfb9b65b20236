"""Numbers to colours: a sequential and a diverging table, round numbers, ticks and units; numpy only.

Sequential: dark violet is low, yellow is high. Diverging: blue is below zero, red above, white is zero. Transparent is
not measured.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from acquire.text.quantity import GAP, MINUS, decimal_mark, unit_of

_SEQUENTIAL = "431480 39349c 1a51b0 046fa5 0187a1 029f9f 06b696 4acc7b 93d866 c9e35b faed5a"
LINES = ("#0060ad", "#bd4a00", "#007a62", "#9a3a80", "#7a5c00", "#56606b")
"""Of curves and gauges on a light ground or over a picture, by their index; told apart with any colour vision."""
LINES_ON_DARK = ("#6db3f2", "#f59453", "#3cc6a8", "#e28cc2", "#d6b64a", "#a4aeb8")
_COLD, _HOT, _BEND = (59, 76, 192), (180, 4, 38), 88.0
_NICE = (1.0, 1.2, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0)

_RGB_TO_XYZ = np.array(
    [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]]
)
_WHITE = _RGB_TO_XYZ.sum(axis=1)


@dataclass(frozen=True, slots=True)
class Unit:
    """How a strain is shown: ``shown = strain * factor``."""

    name: str
    factor: float


MICROSTRAIN, PERCENT = Unit("µm/m", 1e6), Unit("%", 100.0)


def unit_for(largest: float, kind: str = "strain") -> Unit:
    """The unit for strains, or another kind of quantity, up to ``largest``, SI."""
    unit = unit_of(kind, largest)
    return Unit(unit.name, 1 / unit.one)


@lru_cache(maxsize=1)
def sequential_table() -> NDArray[np.uint8]:
    """(256, 3) uint8 sRGB, violet over blue, teal and green to yellow, lighter step by step.

    Between colours of an even rise of lightness in OKLCh, from 0.34 to 0.93; with a colour vision deficiency too.
    """
    anchors = np.array([list(bytes.fromhex(colour)) for colour in _SEQUENTIAL.split()], np.float64)
    places = np.linspace(0, len(anchors) - 1, 256)
    channels = [np.interp(places, np.arange(len(anchors)), channel) for channel in anchors.T]
    table: NDArray[np.uint8] = np.rint(np.stack(channels, axis=1)).astype(np.uint8)
    table.flags.writeable = False
    return table


@lru_cache(maxsize=1)
def diverging_table() -> NDArray[np.uint8]:
    """(256, 3) uint8 sRGB, blue over near-white to red, even in perceived steps.

    Interpolation in Msh space after K. Moreland, Diverging color maps for scientific
    visualization (2009), doi:10.1007/978-3-642-10520-3_9.
    """
    cold, hot = _msh(_COLD), _msh(_HOT)
    half = np.linspace(0.0, 1.0, 128, endpoint=False)[:, None]
    below = _blend(cold, (_BEND, 0.0, _spin(cold, _BEND)), half)
    above = _blend(hot, (_BEND, 0.0, _spin(hot, _BEND)), half)[::-1]
    table: NDArray[np.uint8] = _from_msh(np.concatenate([below, above]))
    table.flags.writeable = False
    return table


def _blend(a: tuple[float, ...], b: tuple[float, ...], s: NDArray[np.float64]) -> NDArray[np.float64]:
    mixed: NDArray[np.float64] = (1.0 - s) * np.array(a) + s * np.array(b)
    return mixed


def _spin(colour: tuple[float, float, float], magnitude: float) -> float:
    # Turns the hue on the way to white, so that the steps stay perceptually even.
    m, s, h = colour
    turn = s * math.sqrt(max(magnitude**2 - m**2, 0.0)) / (m * math.sin(s))
    return h + turn if h > -math.pi / 3 else h - turn


def _msh(rgb: tuple[int, int, int]) -> tuple[float, float, float]:
    c = np.array(rgb) / 255.0
    linear = np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)
    f = _RGB_TO_XYZ @ linear / _WHITE
    f = np.where(f > 0.008856, np.cbrt(f), 7.787 * f + 16 / 116)
    lightness, a, b = 116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])
    m = math.sqrt(lightness**2 + a**2 + b**2)
    return m, math.acos(lightness / m), math.atan2(b, a)


def _from_msh(msh: NDArray[np.float64]) -> NDArray[np.uint8]:
    m, s, h = msh.T
    lightness, a, b = m * np.cos(s), m * np.sin(s) * np.cos(h), m * np.sin(s) * np.sin(h)
    fy = (lightness + 16) / 116
    f = np.stack([fy + a / 500, fy, fy - b / 200], axis=1)
    xyz = np.where(f > 6 / 29, f**3, (f - 16 / 116) / 7.787) * _WHITE
    linear = np.clip(xyz @ np.linalg.inv(_RGB_TO_XYZ).T, 0.0, 1.0)
    srgb = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    return np.asarray(np.rint(srgb * 255), np.uint8)


def colour(
    values: NDArray[np.floating], low: float, high: float, table: NDArray[np.uint8], alpha: int = 255
) -> NDArray[np.uint8]:
    """RGBA of a map.

    Parameters
    ----------
    values : (R, C) float
    low, high : float
        Ends of the colours; beyond, they stay at the ends.
    table : (256, 3) uint8
    alpha : int
        Opacity of valid cells, 0..255; NaN is fully transparent.

    Returns
    -------
    (R, C, 4) uint8
    """
    valid = np.isfinite(values)
    shares = np.clip((np.where(valid, values, low) - low) / (high - low), 0.0, 1.0)
    rgba = np.empty((*values.shape, 4), np.uint8)
    rgba[..., :3] = table[np.rint(shares * 255).astype(np.intp)]
    rgba[..., 3] = np.where(valid, alpha, 0)
    return rgba


def nice_above(value: float) -> float:
    """The smallest round number (1, 1.2, 1.5, 2 ... times a power of ten) >= value > 0."""
    decade = 10.0 ** math.floor(math.log10(value))
    for step in (*_NICE, 10.0):
        if step * decade >= value * (1 - 1e-9):
            return float(f"{step * decade:.3g}")
    return 10.0 * decade


def ticks(low: float, high: float, about: int = 5) -> list[float]:
    """Round numbers within low..high, ``about`` of them."""
    raw = (high - low) / max(about - 1, 1)
    decade = 10.0 ** math.floor(math.log10(raw))
    step = next(s * decade for s in (1.0, 2.0, 2.5, 5.0, 10.0) if s * decade >= raw * (1 - 1e-9))
    first = math.ceil(low / step - 1e-9)
    return [float(f"{k * step:.12g}") for k in range(first, math.floor(high / step + 1e-9) + 1)]


def number(value: float, language: str = "en") -> str:
    """A number for a tick: as short as it can be, thousands apart, a true minus sign."""
    text = f"{abs(value):,.6g}".replace(",", GAP) if abs(value) < 1e7 else f"{abs(value):.3g}"
    text = text.replace(".", decimal_mark(language))
    return MINUS + text if value < 0 else text
