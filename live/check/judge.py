"""The lines of the check: each figure, whether it is good enough, and what to do."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from analysis.quality import Steadiness, aliased, mains_of
from live.check.advice import advice
from live.check.figures import Figures, median
from live.check.shots import FEWEST

MOST_SATURATED, MOST_DARK, MOST_PILED = 1e-4, 0.01, 1e-3
LEAST_LIGHT = 0.3  # of full scale, 99th percentile
LEAST_CONTRAST = 0.05  # of full scale
RADIUS_PX = (
    0.9,
    6.0,
)  # 3 px of full width, the finest that the iDICs guide of good practice has: biased by 0.0003 px
MOST_FLICKER, MOST_WITHOUT_PATTERN, LEAST_SHARP = 0.01, 0.02, 0.7
MOST_NOISE_PX = 0.05  # of one ZOI in one frame
HONEST = 1.5  # measured over predicted noise
WITHOUT_TARGET = 1e-3
"""Strain noise above which a check is no GO where no target is given: a steel yields at twice that."""


@dataclass(frozen=True, slots=True)
class Line:
    """One figure of the check, whether it is good enough, and what to do where it is not.

    What is not ``told`` by the pictures there are is neither good nor bad.
    """

    what: str
    value: str
    good: bool = True
    advice: str = ""
    told: bool = True

    def text(self) -> str:
        """The line for a person."""
        mark = "ok  " if self.told else "?   "
        return f"{mark if self.good else 'LOOK'}  {self.what:<22} {self.value}" + (
            "" if self.good or not self.advice else f"\n      -> {self.advice}"
        )


def judge(figures: Figures, target: float | None = None, most_shift_px: float = 0.05) -> list[Line]:
    """All lines of the check.

    Parameters
    ----------
    figures : Figures
    target : float or None
        Strain noise of one ZOI that the test needs, dimensionless.
    most_shift_px : float, px
        Drift that is accepted.
    """
    return [
        *_few(figures),
        Line("region", figures.region.words),
        *_camera(figures),
        *_light(figures),
        *_pattern(figures),
        *_motion(figures, most_shift_px),
        *_load(figures),
        _floor(figures, target),
        *_gauges(figures),
    ]


def _few(f: Figures) -> Iterator[Line]:
    if f.shots.few:
        told = f"{len(f.shots)}, too few for what changes in time; the pattern is that of the first"
        yield Line("pictures", told)


def _untold(f: Figures, what: str) -> Line:
    return Line(what, f"not told by {f.shots.said}: it takes {FEWEST} of the still specimen", told=False)


def _camera(f: Figures) -> Iterator[Line]:
    if f.shots.lost:
        yield Line("frames lost", f"{f.shots.lost} between {len(f.shots)}", False,
                   "a lower frame rate, a smaller picture (--crop), another port or a faster machine")  # fmt: skip
    automatic = ", ".join(f.automatic)
    yield Line("automatic controls", automatic or "none", not automatic, f"put on manual: {automatic}")
    yield _bits(f)
    told = "not seen from a still picture: it shows as strain once the specimen moves (--dark, --flat take it out)"
    if f.removed is not None:
        told = f"dark and flat took out {f.removed:.2f} GL; what is left is not seen from a still picture"
    yield Line("fixed pattern", told)


def _bits(f: Figures) -> Line:
    d = f.depth
    value, words = f"{d.changing} of {d.stated} change", ""
    if d.unused_below:
        words = (
            f"the lowest {d.unused_below} never change: choose a format with more real bits, or live with it"
        )
    if d.unused_above >= 2:
        words = f"the highest {d.unused_above} are never used: more light, or say the true depth (files: bits=...)"
        words += ", else saturation is not seen"
    return Line("bits", value, not words, words)


def _light(f: Figures) -> Iterator[Line]:
    e = f.exposure
    yield Line("light", f"1 % to 99 % of the pixels from {e.low:.0%} to {e.high:.0%} of full scale",
               e.high >= LEAST_LIGHT, "under-exposed: more light, a longer exposure, or open the aperture")  # fmt: skip
    yield Line("saturated pixels", f"{e.saturated:.3%}", e.saturated <= MOST_SATURATED,
               "less exposure or light, no glare")  # fmt: skip
    if e.dark > MOST_DARK:
        yield Line("black pixels", f"{e.dark:.1%} at zero", False,
                   "raise the black level of the camera, or the light: what is cut off is lost")  # fmt: skip
    if e.piled > MOST_PILED:
        yield Line("clipped below the top", f"{e.piled:.1%} at one highest level", False,
                   "saturated before the end of the scale: less light, or say the true depth (bits=...)")  # fmt: skip
    yield _untold(f, "flicker") if f.shots.few else _flicker(f)
    full = 2**f.shots.camera.bits - 1
    shown = f"{f.noise:.2f} GL of one frame, {f.noise / full:.2%} of full scale"
    if f.shots.few:
        yield Line("noise", f"{shown}, {_noise_from(f)}")
        yield _untold(f, "noise in time")
    else:
        yield Line("noise", shown, f.noise > 0, "every frame is the same: is this a live picture?")


def _noise_from(f: Figures) -> str:
    return "as stated" if f.noise_stated else "as the spectrum of the picture has it"


def _flicker(f: Figures) -> Line:
    s = f.still.light
    value = f"{s.rms:.2%} of the level, drift {s.drift:+.2%}"
    words = "use a steady lamp, or an exposure of whole periods of the mains"
    mains = mains_of(s, 2)
    if mains is not None:
        value += f": lamps on {mains:.0f} Hz mains ({2 * mains:.0f} Hz, seen at {s.frequency:.1f} Hz)"
        words = f"a lamp on direct current, or an exposure of a multiple of {500 / mains:.1f} ms"
    elif s.frequency is not None:
        value += f", mainly at {s.frequency:.1f} Hz"
    standing = [m for m in (50.0, 60.0) if s.rate and aliased(2 * m, s.rate) < 0.02 * s.rate]
    if standing:
        value += f" (at {s.rate:.3g} fps that of {standing[0]:.0f} Hz mains stands still and is not seen)"
    return Line("flicker", value, max(s.rms, abs(s.drift)) <= MOST_FLICKER or math.isnan(s.rms), words)


def _pattern(f: Figures) -> Iterator[Line]:
    full, z = 2**f.shots.camera.bits - 1, f.zois
    contrast = median(z.contrast) / full
    yield Line("contrast (std)", f"{contrast:.1%} of full scale", contrast > LEAST_CONTRAST,
               "more light, a longer exposure, or a pattern of blacker black and whiter white")  # fmt: skip
    low, high = RADIUS_PX
    words = "finer speckle or a wider field of view" if f.radius > high else "coarser speckle, or focus"
    radius = f"{f.radius:.2f} px" if math.isfinite(f.radius) else "none is seen"
    yield Line("speckle radius", f"{radius} (best from 1.5 to 4)", low <= f.radius <= high, words)
    yield _sharpness(f)
    yield _sssig(f)
    share, n = z.without_pattern, z.grid.n_active
    yield Line("ZOIs without pattern", "all" if share == 1 else f"{share:.1%} of {n}",
               share <= MOST_WITHOUT_PATTERN,
               "spray a pattern, set focus and exposure" if share == 1 else
               "restrict them with --roi or --mask, or take larger ZOIs")  # fmt: skip


def _sharpness(f: Figures) -> Line:
    """Of the whole, and whether one side of the picture is softer: the camera or the specimen is tilted."""
    values = f.zois.sharpness
    rows, columns = values.shape
    sides = {
        "left": values[:, : columns // 2],
        "right": values[:, (columns + 1) // 2 :],
        "top": values[: rows // 2],
        "bottom": values[(rows + 1) // 2 :],
    }
    of = {name: m for name, side in sides.items() if math.isfinite(m := median(side))}
    value = f"{f.sharpness:.3f} 1/px"
    if not of:
        return Line("sharpness", "no pattern is seen", False, "spray a pattern, set focus and exposure")
    softest, sharpest = min(of, key=lambda k: of[k]), max(of, key=lambda k: of[k])
    even = of[softest] >= LEAST_SHARP * of[sharpest]
    text = f"{value}, {softest} {of[softest]:.3f}, {sharpest} {of[sharpest]:.3f}"
    return Line(
        "sharpness", text, even, f"softer at the {softest}: set the camera square, close the aperture"
    )


def _sssig(f: Figures) -> Line:
    known = f.zois.sssig[np.isfinite(f.zois.sssig)]
    if not known.any():
        return Line("SSSIG of a ZOI", "none", False, "spray a pattern")
    weak = float(np.percentile(known, 5))
    px = math.sqrt(2) * f.noise / math.sqrt(max(weak, 1e-9))
    value = f"median {np.median(known):.3g}, weakest 5 % {weak:.3g} GL^2/px^2 ({px:.4f} px in one frame)"
    return Line("SSSIG of a ZOI", value, px < MOST_NOISE_PX, "more contrast, larger ZOIs")


def _motion(f: Figures, most_px: float) -> Iterator[Line]:
    s = f.still
    if f.shots.few:
        yield from (_untold(f, what) for what in ("drift", "vibration"))
        return
    if not math.isfinite(s.drift_px):
        yield Line("drift", "not measured", f.zois.without_pattern < 1, "nothing can be followed")
        return
    strain = max((s.exx, s.eyy), key=lambda one: abs(one.drift))
    yield Line("drift", f"{s.drift_px:.4f} px and {strain.drift * 1e6:+.0f} um/m in {s.u.seconds:.3g} s",
               s.drift_px <= most_px, "keep specimen and camera still")  # fmt: skip
    shake = s.worse
    yield Line("vibration", f"{_seen(shake, 1, 'px', 4)}, {_seen(s.worse_strain, 1e6, 'um/m', 0)}",
               shake.vibration <= most_px, "a stiffer tripod, a quiet floor, no fan on the bench")  # fmt: skip


def _seen(s: Steadiness, unit: float, name: str, digits: int) -> str:
    """A vibration, or that it is below what noise lets see; with its frequency."""
    if not s.vibration > s.noise / 2:
        return f"less than {s.noise * unit:.{digits}f} {name}"
    text = f"{s.vibration * unit:.{digits}f} {name} rms"
    if s.frequency is None:
        return text
    mains = mains_of(s, 1)
    told = f", as {mains:.0f} Hz mains would" if mains is not None else ""
    return f"{text}, mainly at {s.frequency:.1f} Hz{told}"


def _load(f: Figures) -> Iterator[Line]:
    if f.load is not None:
        value = f"{f.load.rate:.4g} 1/s, noise {f.load.noise_N:.3g} N, mean {f.load.mean_N:.5g} N"
        yield Line("load cell", value, f.load.ready, "; ".join(f.load.remarks))


def _floor(f: Figures, target: float | None) -> Line:
    what = "strain noise"
    noise = None if f.floor is None else f.floor.of(f.burst)
    typical = median(f.zois.sigma)
    if noise is None and not math.isfinite(typical):
        words = "a larger region, smaller ZOIs, or a pattern"
        return Line(what, f"not measured: too few ZOIs of {f.zoi} px", False, words)
    known = typical if noise is None else noise.known
    told = f"{known * 1e6:.0f} um/m predicted"
    if f.shots.few:
        told += f" from the noise {_noise_from(f)}"
    elif noise is not None:
        told = f"{noise.known * 1e6:.0f} um/m measured, {noise.predicted * 1e6:.0f} predicted"
    value = f"{told} (one ZOI of {f.zoi} px, burst of {f.burst})"
    if noise is not None and noise.measured > HONEST * noise.predicted:
        return Line(what, value, False, "something moves or flickers: vibration, air, lamp")
    wanted = WITHOUT_TARGET if target is None else target
    asked = "asked for" if target is not None else "that are judged against where no --target is given"
    enough = known <= wanted
    words = f"more than the {wanted * 1e6:.1f} um/m {asked}: {'' if enough else advice(f, wanted)}"
    return Line(what, value, enough, words)


def _gauges(f: Figures) -> Iterator[Line]:
    """What is reported in the end is a gauge or a mean, not one ZOI."""
    for gauge in f.gauges:
        name = f"noise of {gauge.name}" if gauge.name else "noise of the mean"
        value = f"{gauge.sigma * 1e6:.1f} um/m predicted (burst of {f.burst})"
        yield Line(name, gauge.reason or value, not gauge.reason, "move it, or take smaller ZOIs")
