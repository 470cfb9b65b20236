"""The lines of a check: each figure, whether it is good enough, and what to change."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from acquire.text import Amount, Message, joined
from analysis.quality.pattern import SPECKLE_RADIUS_PX
from analysis.quality.steadiness import aliased, mains_of
from live.setup.check.check_list import CheckFigures, median
from live.setup.check.lines import CheckLine, advice, motion_lines, not_measured

MAX_SATURATED, MAX_DARK, MAX_PILED = 1e-4, 0.01, 1e-3
MIN_LIGHT = 0.3  # of full scale, 99th percentile
MIN_CONTRAST = 0.05  # of full scale
MAX_FLICKER, MAX_WITHOUT_PATTERN, MIN_SHARPNESS_RATIO = 0.01, 0.02, 0.7
MAX_NOISE_PX = 0.05  # of one ZOI in one frame
MAX_OVER_PREDICTED = 1.5  # measured over predicted noise
DEFAULT_TARGET = 1e-3
"""Largest strain noise for GO without a target: half the yield strain of a steel."""


def check_lines(
    figures: CheckFigures, target: float | None = None, max_shift_px: float = 0.05
) -> list[CheckLine]:
    """All lines of the check.

    Parameters
    ----------
    figures : CheckFigures
    target : float or None
        Largest strain noise of one ZOI for the test, dimensionless.
    max_shift_px : float, px
        Largest accepted drift and vibration.
    """
    return [
        *_few(figures),
        CheckLine("region", figures.region.words),
        *_camera(figures),
        *_light(figures),
        *_pattern(figures),
        *motion_lines(figures, max_shift_px),
        *_load(figures),
        _floor(figures, target),
        *_gauges(figures),
    ]


def _few(f: CheckFigures) -> Iterator[CheckLine]:
    if f.stack.few:
        value = Message(
            "{count}, too few for what changes in time; the pattern is that of the first", len(f.stack)
        )
        yield CheckLine("pictures", value)


def _camera(f: CheckFigures) -> Iterator[CheckLine]:
    yield from (CheckLine("camera", warning, measured=False) for warning in f.stack.camera.warnings)
    if f.stack.lost:
        yield CheckLine(
            "frames lost",
            Message("{lost} between the {count} looked at", f.stack.lost, len(f.stack)),
            False,
            "take a lower frame rate, a smaller picture (crop), another port or a faster machine",
        )
    automatic = ", ".join(f.automatic)
    yield CheckLine(
        "automatic controls",
        automatic or Message("none"),
        not automatic,
        Message("put on manual: {automatic}", automatic),
    )
    yield _bits(f)
    value = Message(
        "not visible in a still picture: it shows as strain when the specimen moves; dark and flat "
        "pictures correct it"
    )
    if f.removed is not None:
        value = Message(
            "dark and flat corrected {removed:.2f} GL; the rest is not visible in a still picture", f.removed
        )
    yield CheckLine("fixed pattern", value)
    if f.blocks:
        value = Message(
            "blocks of 8 px: strain is less certain than below once the specimen moves; the test states by how "
            "much"
        )
        yield CheckLine("compression", value)
    elif f.picture:
        yield CheckLine("picture", f.picture)


def _bits(f: CheckFigures) -> CheckLine:
    d = f.depth
    value, words = Message("{changing} of {stated} change", d.changing, d.stated), ""
    if d.unused_below:
        words = Message(
            "the lowest {unused_below} never change: choose a format with more real bits, or live with it",
            d.unused_below,
        )
    if d.unused_above >= 2:
        words = Message(
            "the highest {unused_above} are never used: more light, or give the true depth (files: bits=...)",
            d.unused_above,
        )
        words += Message(", else saturation is not found")
    return CheckLine("bits", value, not words, words)


def _light(f: CheckFigures) -> Iterator[CheckLine]:
    e = f.exposure
    yield CheckLine(
        "light",
        Message("1 % to 99 % of the pixels from {low:.0%} to {high:.0%} of full scale", e.low, e.high),
        e.high >= MIN_LIGHT,
        "under-exposed: more light, a longer exposure, or open the aperture",
    )
    yield CheckLine(
        "saturated pixels",
        Message("{share:.3%}", e.saturated),
        e.saturated <= MAX_SATURATED,
        "less exposure or light, no glare",
    )
    if e.dark > MAX_DARK:
        yield CheckLine(
            "black pixels",
            Message("{dark:.1%} at zero", e.dark),
            False,
            "raise the black level of the camera, or the light: what is cut off is lost",
        )
    if e.piled > MAX_PILED:
        yield CheckLine(
            "clipped below the top",
            Message("{piled:.1%} at one highest level", e.piled),
            False,
            "less light; where this is where the camera saturates, give it (bits=... or white=...)",
        )
    yield not_measured(f, "flicker") if f.stack.few else _flicker(f)
    full = f.stack.camera.saturation
    shown = Message("{noise:.2f} GL of one frame, {noise2:.2%} of full scale", f.noise, f.noise / full)
    if f.stack.few:
        yield CheckLine("noise", Message("{shown}, {noise_source}", shown, _noise_source(f)))
        yield not_measured(f, Message("noise in time"))
    else:
        yield CheckLine("noise", shown, f.noise > 0, "every frame is the same: is this a live picture?")


def _noise_source(f: CheckFigures) -> str:
    return Message("as given") if f.noise_stated else Message("from the spectrum of the picture")


def _flicker(f: CheckFigures) -> CheckLine:
    s = f.still.light
    value = Message("{rms:.2%} of the level, drift {drift:+.2%}", s.rms, s.drift)
    words = Message("use a steady lamp, or an exposure of whole periods of the mains")
    mains = mains_of(s, 2)
    if mains is not None:
        value += Message(
            ": lamps on {mains:.0f} Hz mains ({mains2:.0f} Hz, seen at {frequency:.1f} Hz)",
            mains,
            2 * mains,
            s.frequency,
        )
        words = Message(
            "a lamp on direct current, or an exposure of a multiple of {mains:.1f} ms", 500 / mains
        )
    elif s.frequency is not None:
        value += Message(", mainly at {frequency:.1f} Hz", s.frequency)
    standing = [m for m in (50.0, 60.0) if s.rate and aliased(2 * m, s.rate) < 0.02 * s.rate]
    if standing:
        value += Message(
            " (at {rate:.3g} fps that of {standing:.0f} Hz mains stands still and is not visible)",
            s.rate,
            standing[0],
        )
    return CheckLine("flicker", value, max(s.rms, abs(s.drift)) <= MAX_FLICKER or math.isnan(s.rms), words)


def _pattern(f: CheckFigures) -> Iterator[CheckLine]:
    full, z = f.stack.camera.saturation, f.zois
    contrast = median(z.contrast) / full
    yield CheckLine("contrast (std)", Message("{contrast:.1%} of full scale", contrast), contrast > MIN_CONTRAST,
               "more light, a longer exposure, or a pattern of blacker black and whiter white")  # fmt: skip
    low, high = SPECKLE_RADIUS_PX
    words = (
        Message("finer speckle or a wider field of view")
        if f.radius > high
        else Message("coarser speckle, or focus")
    )
    radius = Message("{radius:.2f} px", f.radius) if math.isfinite(f.radius) else Message("none is visible")
    yield CheckLine(
        "speckle radius",
        Message("{radius} (from {low:g} to {high:g})", radius, low, high),
        low <= f.radius <= high,
        words,
    )
    if f.repetition:
        words = Message(
            "a random pattern; else more pictures a second: displacements may be wrong by a period"
        )
        yield CheckLine("repetition", f.repetition, False, words)
    yield _sharpness(f)
    yield _sssig(f)
    share, n = z.without_pattern, z.grid.n_active
    yield CheckLine("ZOIs without pattern", Message("all") if share == 1 else Message("{share:.1%} of {n}", share, n),
               share <= MAX_WITHOUT_PATTERN,
               Message("spray a pattern, set focus and exposure") if share == 1 else
               Message("restrict them with --roi or --mask, or take larger ZOIs"))  # fmt: skip


def _sharpness(f: CheckFigures) -> CheckLine:
    """Sharpness of the whole and of the sides: a softer side means that camera or specimen is tilted."""
    values = f.zois.sharpness
    rows, columns = values.shape
    sides = {
        "left": values[:, : columns // 2],
        "right": values[:, (columns + 1) // 2 :],
        "top": values[: rows // 2],
        "bottom": values[(rows + 1) // 2 :],
    }
    of = {name: m for name, side in sides.items() if math.isfinite(m := median(side))}
    value = Message("{sharpness:.3f} 1/px", f.sharpness)
    if not of:
        return CheckLine(
            "sharpness", Message("no pattern is visible"), False, "spray a pattern, set focus and exposure"
        )
    softest, sharpest = min(of, key=lambda k: of[k]), max(of, key=lambda k: of[k])
    even = of[softest] >= MIN_SHARPNESS_RATIO * of[sharpest]
    text = Message(
        "{value}, {softest} {of:.3f}, {sharpest} {of2:.3f}",
        value,
        Message(softest),
        of[softest],
        Message(sharpest),
        of[sharpest],
    )
    return CheckLine(
        "sharpness",
        text,
        even,
        Message("softer at the {softest}: set the camera square, close the aperture", Message(softest)),
    )


def _sssig(f: CheckFigures) -> CheckLine:
    known = f.zois.sssig[np.isfinite(f.zois.sssig)]
    if not known.any():
        return CheckLine("SSSIG of a ZOI", Message("none"), False, "spray a pattern")
    weak = float(np.percentile(known, 5))
    px = math.sqrt(2) * f.noise / math.sqrt(max(weak, 1e-9))
    value = Message(
        "median {typical:.3g}, weakest 5 % {weak:.3g} GL^2/px^2 ({px:.4f} px in one frame)",
        np.median(known),
        weak,
        px,
    )
    return CheckLine("SSSIG of a ZOI", value, px < MAX_NOISE_PX, "more contrast, larger ZOIs")


def _load(f: CheckFigures) -> Iterator[CheckLine]:
    if f.load is not None:
        value = Message(
            "{rate:.4g} 1/s, noise {noise_N:.3g} N, mean {mean_text} N",
            f.load.rate,
            f.load.noise_N,
            f.load.mean_text,
        )
        yield CheckLine("load cell", value, f.load.ready, joined("; ", f.load.remarks))


def _floor(f: CheckFigures, target: float | None) -> CheckLine:
    what = Message("strain noise")
    noise = None if f.floor is None else f.floor.of(f.burst)
    typical = median(f.zois.sigma)
    if noise is None and not math.isfinite(typical):
        words = Message("a larger region, smaller ZOIs, or a pattern")
        return CheckLine(what, Message("not measured: too few ZOIs of {zoi} px", f.zoi), False, words)
    known = typical if noise is None else noise.known
    found = Message("{known} predicted", Amount("strain", known))
    if f.stack.few:
        found += Message(", noise {noise_source}", _noise_source(f))
    elif noise is not None:
        found = Message(
            "{known} measured, {predicted} predicted",
            Amount("strain", noise.known),
            Amount("strain", noise.predicted),
        )
    value = Message("{found} (one ZOI of {zoi} px, burst of {burst})", found, f.zoi, f.burst)
    if noise is not None and noise.measured > MAX_OVER_PREDICTED * noise.predicted:
        return CheckLine(what, value, False, "something moves or flickers: vibration, air, lamp")
    wanted = DEFAULT_TARGET if target is None else target
    limit = (
        Message("asked for") if target is not None else Message("that are the limit where no target is given")
    )
    enough = known <= wanted
    words = Message(
        "more than the {wanted:.1f} µm/m {limit}: {value}",
        wanted * 1e6,
        limit,
        "" if enough else advice(f, wanted),
    )
    return CheckLine(what, value, enough, words)


def _gauges(f: CheckFigures) -> Iterator[CheckLine]:
    """Noise of the gauges and the mean: a test reports these, not one ZOI."""
    for gauge in f.gauges:
        name = Message("noise of {name}", gauge.name) if gauge.name else Message("noise of the region")
        value = Message("{sigma:.1f} µm/m predicted (burst of {burst})", gauge.sigma * 1e6, f.burst)
        yield CheckLine(name, gauge.reason or value, not gauge.reason, "move it, or take smaller ZOIs")
        if gauge.part:
            yield CheckLine("gauge", gauge.part, False, "")


# -- advice on the strain noise -----------------------------------------------------------------
