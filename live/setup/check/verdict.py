"""The lines of a check: each figure, whether it is good enough, and what to change.

``advice`` derives from the table of strain noise what reaches a target.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from analysis.quality.pattern import SPECKLE_RADIUS_PX
from analysis.quality.steadiness import Steadiness, aliased, mains_of, strain_drifts
from live.setup.check.check_list import CheckFigures, median
from live.setup.check.noise_floor import ZoiFloor
from live.setup.check.sample import MIN_FRAMES

MAX_SATURATED, MAX_DARK, MAX_PILED = 1e-4, 0.01, 1e-3
MIN_LIGHT = 0.3  # of full scale, 99th percentile
MIN_CONTRAST = 0.05  # of full scale
MAX_FLICKER, MAX_WITHOUT_PATTERN, MIN_SHARPNESS_RATIO = 0.01, 0.02, 0.7
MAX_DILATATION = 5e-5  # common drift of exx and eyy
MAX_NOISE_PX = 0.05  # of one ZOI in one frame
MAX_OVER_PREDICTED = 1.5  # measured over predicted noise
DEFAULT_TARGET = 1e-3
"""Largest strain noise for GO without a target: half the yield strain of a steel."""
FULL_LIGHT = 0.95  # of full scale: more light saturates
MAX_BURST = 1000


@dataclass(frozen=True, slots=True)
class CheckLine:
    """One figure of the check, whether it is good enough, and what to do if it is not.

    A figure that the pictures do not give (not ``measured``) is neither good nor bad.
    """

    what: str
    value: str
    good: bool = True
    advice: str = ""
    measured: bool = True

    def text(self) -> str:
        """The line as printed."""
        mark = "ok  " if self.measured else "?   "
        return f"{mark if self.good else 'LOOK'}  {self.what:<22} {self.value}" + (
            "" if self.good or not self.advice else f"\n      -> {self.advice}"
        )


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
        *_motion(figures, max_shift_px),
        *_load(figures),
        _floor(figures, target),
        *_gauges(figures),
    ]


def _few(f: CheckFigures) -> Iterator[CheckLine]:
    if f.stack.few:
        value = f"{len(f.stack)}, too few for what changes in time; the pattern is that of the first"
        yield CheckLine("pictures", value)


def _not_measured(f: CheckFigures, what: str) -> CheckLine:
    return CheckLine(
        what,
        f"not measured from {f.stack.count_text}: it takes {MIN_FRAMES} of the still specimen",
        measured=False,
    )


def _camera(f: CheckFigures) -> Iterator[CheckLine]:
    yield from (CheckLine("camera", warning, measured=False) for warning in f.stack.camera.warnings)
    if f.stack.lost:
        yield CheckLine("frames lost", f"{f.stack.lost} between the {len(f.stack)} looked at", False,
                   "a lower frame rate, a smaller picture (--crop), another port or a faster machine")  # fmt: skip
    automatic = ", ".join(f.automatic)
    yield CheckLine("automatic controls", automatic or "none", not automatic, f"put on manual: {automatic}")
    yield _bits(f)
    value = "not visible in a still picture: it shows as strain when the specimen moves (--dark, --flat correct it)"
    if f.removed is not None:
        value = f"dark and flat corrected {f.removed:.2f} GL; the rest is not visible in a still picture"
    yield CheckLine("fixed pattern", value)
    if f.blocks:
        value = "blocks of 8 px: strain is less certain than below once the specimen moves; the test states by how much"
        yield CheckLine("compression", value)
    elif f.picture:
        yield CheckLine("picture", f.picture)


def _bits(f: CheckFigures) -> CheckLine:
    d = f.depth
    value, words = f"{d.changing} of {d.stated} change", ""
    if d.unused_below:
        words = (
            f"the lowest {d.unused_below} never change: choose a format with more real bits, or live with it"
        )
    if d.unused_above >= 2:
        words = f"the highest {d.unused_above} are never used: more light, or give the true depth (files: bits=...)"
        words += ", else saturation is not found"
    return CheckLine("bits", value, not words, words)


def _light(f: CheckFigures) -> Iterator[CheckLine]:
    e = f.exposure
    yield CheckLine("light", f"1 % to 99 % of the pixels from {e.low:.0%} to {e.high:.0%} of full scale",
               e.high >= MIN_LIGHT, "under-exposed: more light, a longer exposure, or open the aperture")  # fmt: skip
    yield CheckLine("saturated pixels", f"{e.saturated:.3%}", e.saturated <= MAX_SATURATED,
               "less exposure or light, no glare")  # fmt: skip
    if e.dark > MAX_DARK:
        yield CheckLine("black pixels", f"{e.dark:.1%} at zero", False,
                   "raise the black level of the camera, or the light: what is cut off is lost")  # fmt: skip
    if e.piled > MAX_PILED:
        yield CheckLine("clipped below the top", f"{e.piled:.1%} at one highest level", False,
                   "less light; where this is where the camera saturates, give it (bits=... or white=...)")  # fmt: skip
    yield _not_measured(f, "flicker") if f.stack.few else _flicker(f)
    full = f.stack.camera.saturation
    shown = f"{f.noise:.2f} GL of one frame, {f.noise / full:.2%} of full scale"
    if f.stack.few:
        yield CheckLine("noise", f"{shown}, {_noise_source(f)}")
        yield _not_measured(f, "noise in time")
    else:
        yield CheckLine("noise", shown, f.noise > 0, "every frame is the same: is this a live picture?")


def _noise_source(f: CheckFigures) -> str:
    return "as given" if f.noise_stated else "from the spectrum of the picture"


def _flicker(f: CheckFigures) -> CheckLine:
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
        value += f" (at {s.rate:.3g} fps that of {standing[0]:.0f} Hz mains stands still and is not visible)"
    return CheckLine("flicker", value, max(s.rms, abs(s.drift)) <= MAX_FLICKER or math.isnan(s.rms), words)


def _pattern(f: CheckFigures) -> Iterator[CheckLine]:
    full, z = f.stack.camera.saturation, f.zois
    contrast = median(z.contrast) / full
    yield CheckLine("contrast (std)", f"{contrast:.1%} of full scale", contrast > MIN_CONTRAST,
               "more light, a longer exposure, or a pattern of blacker black and whiter white")  # fmt: skip
    low, high = SPECKLE_RADIUS_PX
    words = "finer speckle or a wider field of view" if f.radius > high else "coarser speckle, or focus"
    radius = f"{f.radius:.2f} px" if math.isfinite(f.radius) else "none is visible"
    yield CheckLine("speckle radius", f"{radius} (from {low:g} to {high:g})", low <= f.radius <= high, words)
    if f.repetition:
        words = "a random pattern; else more pictures a second: displacements may be wrong by a period"
        yield CheckLine("repetition", f.repetition, False, words)
    yield _sharpness(f)
    yield _sssig(f)
    share, n = z.without_pattern, z.grid.n_active
    yield CheckLine("ZOIs without pattern", "all" if share == 1 else f"{share:.1%} of {n}",
               share <= MAX_WITHOUT_PATTERN,
               "spray a pattern, set focus and exposure" if share == 1 else
               "restrict them with --roi or --mask, or take larger ZOIs")  # fmt: skip


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
    value = f"{f.sharpness:.3f} 1/px"
    if not of:
        return CheckLine(
            "sharpness", "no pattern is visible", False, "spray a pattern, set focus and exposure"
        )
    softest, sharpest = min(of, key=lambda k: of[k]), max(of, key=lambda k: of[k])
    even = of[softest] >= MIN_SHARPNESS_RATIO * of[sharpest]
    text = f"{value}, {softest} {of[softest]:.3f}, {sharpest} {of[sharpest]:.3f}"
    return CheckLine(
        "sharpness", text, even, f"softer at the {softest}: set the camera square, close the aperture"
    )


def _sssig(f: CheckFigures) -> CheckLine:
    known = f.zois.sssig[np.isfinite(f.zois.sssig)]
    if not known.any():
        return CheckLine("SSSIG of a ZOI", "none", False, "spray a pattern")
    weak = float(np.percentile(known, 5))
    px = math.sqrt(2) * f.noise / math.sqrt(max(weak, 1e-9))
    value = f"median {np.median(known):.3g}, weakest 5 % {weak:.3g} GL^2/px^2 ({px:.4f} px in one frame)"
    return CheckLine("SSSIG of a ZOI", value, px < MAX_NOISE_PX, "more contrast, larger ZOIs")


def _motion(f: CheckFigures, max_px: float) -> Iterator[CheckLine]:
    if f.lens:
        yield CheckLine("lens", f.lens)
    s = f.still
    if f.stack.few:
        yield from (_not_measured(f, what) for what in ("drift", "vibration"))
        return
    if not math.isfinite(s.drift_px):
        yield CheckLine("drift", "not measured", f.zois.without_pattern < 1, "no ZOI can be followed")
        return
    pulled = [one for one in (s.exx, s.eyy) if strain_drifts(one.drift, one.sigma_drift)]
    strain = max(pulled or (s.exx, s.eyy), key=lambda one: abs(one.drift))
    words = "keep specimen and camera still"
    if pulled:
        words = "strain changes: stop the machine, take the load off, let the specimen rest, then check again"
    yield CheckLine("drift", f"{s.drift_px:.4f} px and {strain.drift * 1e6:+.0f} µm/m in {s.u.seconds:.3g} s",
               s.drift_px <= max_px and not pulled, words)  # fmt: skip
    if s.dilatation:
        yield CheckLine("distance", f"exx and eyy drift alike, {s.dilatation * 1e6:+.0f} µm/m: it changes by"
                   f" {abs(s.dilatation):.1e} of the stand-off", abs(s.dilatation) < MAX_DILATATION,
                   "warm up the camera, clamp grips and tripod, or hang plates (docs/optics.md)")  # fmt: skip
    across, down = s.keystone
    if across:
        yield CheckLine("tilt", f"strain drifts by {across * 1e6:+.0f} µm/m from left to right, in x and y alike",
                   abs(across) < MAX_DILATATION,
                   "clamp grips and tripod, warm up the camera, or hang plates (docs/optics.md)")  # fmt: skip
    if down:
        yield CheckLine("tilt", f"strain drifts by {down * 1e6:+.0f} µm/m from top to bottom, in x and y alike",
                   abs(down) < MAX_DILATATION,
                   "clamp grips and tripod, warm up the camera, or hang plates (docs/optics.md)")  # fmt: skip
    shake = s.worse
    yield CheckLine("vibration", f"{_vibration(shake, 1, 'px', 4)}, {_vibration(s.worse_strain, 1e6, 'µm/m', 0)}",
               shake.vibration <= max_px, "a stiffer tripod, a quiet floor, no fan on the bench")  # fmt: skip


def _vibration(s: Steadiness, unit: float, name: str, digits: int) -> str:
    """A vibration with its frequency, or its upper limit by the noise."""
    if not s.vibration > s.noise / 2:
        return f"less than {s.noise * unit:.{digits}f} {name}"
    text = f"{s.vibration * unit:.{digits}f} {name} rms"
    if s.frequency is None:
        return text
    mains = mains_of(s, 1)
    cause = f", as from {mains:.0f} Hz mains" if mains is not None else ""
    return f"{text}, mainly at {s.frequency:.1f} Hz{cause}"


def _load(f: CheckFigures) -> Iterator[CheckLine]:
    if f.load is not None:
        value = f"{f.load.rate:.4g} 1/s, noise {f.load.noise_N:.3g} N, mean {f.load.mean_text} N"
        yield CheckLine("load cell", value, f.load.ready, "; ".join(f.load.remarks))


def _floor(f: CheckFigures, target: float | None) -> CheckLine:
    what = "strain noise"
    noise = None if f.floor is None else f.floor.of(f.burst)
    typical = median(f.zois.sigma)
    if noise is None and not math.isfinite(typical):
        words = "a larger region, smaller ZOIs, or a pattern"
        return CheckLine(what, f"not measured: too few ZOIs of {f.zoi} px", False, words)
    known = typical if noise is None else noise.known
    found = f"{known * 1e6:.0f} µm/m predicted"
    if f.stack.few:
        found += f", noise {_noise_source(f)}"
    elif noise is not None:
        found = f"{noise.known * 1e6:.0f} µm/m measured, {noise.predicted * 1e6:.0f} predicted"
    value = f"{found} (one ZOI of {f.zoi} px, burst of {f.burst})"
    if noise is not None and noise.measured > MAX_OVER_PREDICTED * noise.predicted:
        return CheckLine(what, value, False, "something moves or flickers: vibration, air, lamp")
    wanted = DEFAULT_TARGET if target is None else target
    limit = "asked for" if target is not None else "that are the limit without --target"
    enough = known <= wanted
    words = f"more than the {wanted * 1e6:.1f} µm/m {limit}: {'' if enough else advice(f, wanted)}"
    return CheckLine(what, value, enough, words)


def _gauges(f: CheckFigures) -> Iterator[CheckLine]:
    """Noise of the gauges and the mean: a test reports these, not one ZOI."""
    for gauge in f.gauges:
        name = f"noise of {gauge.name}" if gauge.name else "noise of the region"
        value = f"{gauge.sigma * 1e6:.1f} µm/m predicted (burst of {f.burst})"
        yield CheckLine(name, gauge.reason or value, not gauge.reason, "move it, or take smaller ZOIs")


# -- advice on the strain noise -----------------------------------------------------------------


def reaching(floors: Sequence[ZoiFloor], target: float) -> list[tuple[ZoiFloor, int]]:
    """For each size of ZOI the shortest burst, at the lowest order, with a noise of at most ``target``."""
    found: dict[int, tuple[ZoiFloor, int]] = {}
    for floor in floors:
        for noise in floor.noises:
            best = found.get(floor.zoi)
            if noise.known <= target and (best is None or noise.burst < best[1]):
                found[floor.zoi] = (floor, noise.burst)
    return [found[zoi] for zoi in sorted(found)]


def advice(figures: CheckFigures, target: float) -> str:
    """What to change for a strain noise of one ZOI of at most ``target`` (dimensionless)."""
    ways = list(_ways(figures, target))
    if ways:
        return ", or ".join(ways)
    if not figures.floors:
        return "the table of phasedic check shows what reaches it"
    return "nothing here reaches it: more contrast, a finer pattern, a closer or quieter camera, more light"


def _ways(figures: CheckFigures, target: float) -> Iterator[str]:
    now = figures.floor
    for floor, burst in reaching(figures.floors, target):
        same_zoi, same_burst = floor.zoi == figures.zoi, burst == figures.burst
        order = "" if floor.order == figures.order else f" of order {floor.order}"
        if same_zoi:
            yield f"burst {burst}{order}"
        elif same_burst or burst < figures.burst:
            yield f"ZOI {floor.zoi}{order}"
            break
        else:
            yield f"ZOI {floor.zoi}{order} and burst {burst}"
    noise = None if now is None else now.of(figures.burst)
    if now is None or noise is None or not noise.known > target:
        return
    if not any(floor.zoi == figures.zoi for floor, _ in reaching(figures.floors, target)):
        yield from _longer(now, figures.burst, noise.known, target)
    yield _more_light(figures, (noise.known / target) ** 2)


def _longer(floor: ZoiFloor, burst: int, noise: float, target: float) -> Iterator[str]:
    """A burst beyond the table; the noise of the reference limits its effect."""
    one = noise**2 / (1 / floor.reference + 1 / burst)
    rest = target**2 / one - 1 / floor.reference
    if rest > 1 / MAX_BURST:
        yield f"burst {math.ceil(1 / rest)} with ZOI {floor.zoi}"
    elif 2 * one / target**2 < MAX_BURST:
        both = math.ceil(2 * one / target**2)
        yield f"burst {both} and a reference of {both} with ZOI {floor.zoi}"


def _more_light(figures: CheckFigures, factor: float) -> str:
    """More light or contrast; with shot noise, twice the light gives 1.4 times the signal-to-noise ratio."""
    possible = FULL_LIGHT / max(figures.exposure.high, 1e-3)
    times = "twice" if 1.8 < factor < 2.2 else f"{factor:.1f} times"
    if factor <= possible:
        return f"{times} the light or exposure"
    need = math.sqrt(factor / max(possible, 1.0))
    return f"{need:.1f} times the contrast (light helps {possible:.1f} times, then it saturates)"
