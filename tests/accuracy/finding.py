"""Pictures in which the pattern is hard to find again: a block that leaps, patterns that repeat, large steps.

Every picture is evaluated in the deformed place. A case gives the ZOIs whose pattern stays in the picture, the share of
them measured right (within 0.2 px), and the number of valid ZOIs that are wrong.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis import PhaseKernel, Roi, StrainField, ZoiGrid
from tests.accuracy.truth import Speckle, affine, pixels

Array = NDArray[np.float64]
Pattern = Callable[[Array, Array], Array]

SHAPE = (400, 480)
NOISE_GL = 1.0
PERIOD = 9.0
RIGHT_PX = 0.2
SPECKLE = Speckle(2.5, 4, span=600)


@dataclass(frozen=True)
class Found:
    """ZOIs that could be measured, the share of them that is right, and all that are valid and wrong."""

    zois: int
    right: float
    wrong: int


def picture(level: Array, seed: int) -> NDArray[np.uint8]:
    """8 bits, with noise."""
    noise = np.random.default_rng(seed).normal(0, NOISE_GL, level.shape)
    return np.clip(np.rint(255 * level + noise), 0, 255).astype(np.uint8)


def grid(size: int, step: int) -> ZoiGrid:
    return ZoiGrid.cover(Roi(0, 0, SHAPE[1], SHAPE[0]), size, step)


def compared(field: StrainField, moved: tuple[Array, Array], truth: tuple[Array, Array]) -> Found:
    """A field against its truth; ``moved`` are where the centres come to lie, from the centre of the picture."""
    room = [side / 2 - 0.75 * field.grid.size for side in SHAPE[::-1]]
    stays = (np.abs(moved[0]) < room[0]) & (np.abs(moved[1]) < room[1])
    right = field.ok & (np.hypot(field.u - truth[0], field.v - truth[1]) < RIGHT_PX)
    return Found(int(stays.sum()), float(right[stays].mean()), int((field.ok & ~right).sum()))


def centres(zois: ZoiGrid) -> tuple[Array, Array]:
    """Of the ZOIs, from the centre of the picture, px."""
    x, y = np.meshgrid(zois.x - (SHAPE[1] - 1) / 2, zois.y - (SHAPE[0] - 1) / 2)
    return x, y


# -- large steps ---------------------------------------------------------------------------------------------------


def turned(degrees: float) -> dict[str, float]:
    a = np.deg2rad(degrees)
    return {"du_dx": np.cos(a) - 1, "du_dy": -np.sin(a), "dv_dx": np.sin(a), "dv_dy": np.cos(a) - 1}


JUMPS: dict[str, tuple[dict[str, float], float]] = {
    "30 % of strain": ({"du_dx": 0.3, "dv_dy": -0.09}, 0.95),
    "30 % of compression": ({"du_dx": -0.3, "dv_dy": 0.09}, 0.95),
    "turned by 45 degrees": (turned(45), 0.9),
    "turned by 170 degrees": (turned(170), 0.9),
}


def jump(motion: dict[str, float], size: int, step: int) -> Found:
    """One step from nothing."""
    zois = grid(size, step)
    first, last = (picture(SPECKLE.at(*affine(SHAPE, **m)), k) for k, m in enumerate(({}, motion)))
    field = PhaseKernel(first, zois, noise=NOISE_GL).measure(last, noise=NOISE_GL)
    x, y = centres(zois)
    u = motion["du_dx"] * x + motion.get("du_dy", 0.0) * y
    v = motion.get("dv_dx", 0.0) * x + motion["dv_dy"] * y
    return compared(field, (x + u, y + v), (u, v))


def unrelated(size: int, step: int, pictures: int) -> int:
    """ZOIs accepted between pictures that have nothing to do with each other, tracked and from nothing."""
    zois, accepted = grid(size, step), 0
    for k in range(pictures):
        first, other = (picture(Speckle(2.5, 50 + 2 * k + i, span=600).at(*pixels(SHAPE)), k) for i in (0, 1))
        kernel = PhaseKernel(first, zois, noise=NOISE_GL)
        start = kernel.measure(first, noise=NOISE_GL)
        accepted += sum(kernel.measure(other, s, noise=NOISE_GL).n_valid for s in (None, start))
    return accepted


# -- patterns that repeat ------------------------------------------------------------------------------------------


def crossed(x: Array, y: Array) -> Array:
    """Two crossed sines."""
    k = 2 * np.pi / PERIOD
    return 0.5 + 0.15 * (np.sin(k * x) + np.sin(k * y))


def dots(x: Array, y: Array) -> Array:
    """Blobs on a square lattice."""
    dx, dy = (a - PERIOD * np.round(a / PERIOD) for a in (x, y))
    return 0.25 + 0.5 * np.exp(-(dx**2 + dy**2) / (2 * 2.0**2))


def weave(x: Array, y: Array) -> Array:
    """Threads that pass over and under one another."""
    k = np.pi / PERIOD
    over = np.sin(k * x) * np.sin(k * y)
    return 0.5 + 0.2 * np.where(over > 0, np.cos(2 * k * x), np.cos(2 * k * y)) * np.abs(over)


def cornered(pattern: Pattern) -> Pattern:
    """The same with a corner of random pattern."""

    def level(x: Array, y: Array) -> Array:
        depth = np.clip(0.5 - np.maximum(x + 90, y + 70), 0, 1)
        return depth * SPECKLE.at(x, y) + (1 - depth) * pattern(x, y)

    return level


PATTERNS: dict[str, Pattern] = {"two crossed sines": crossed, "dots": dots, "weave": weave}
MOTIONS: dict[str, tuple[float, ...]] = {
    "still": (0.0, 0.0, 0.0),
    "0.3 of a period a picture": (0.3, 0.6, 0.9, 1.2, 1.5),
    "0.7 in one step beside a corner of random pattern": (0.0, 0.7, 0.7),
    "0.7 at once beside a corner of random pattern": (0.7,),
}


def repeated(pattern: Pattern, shifts: tuple[float, ...], size: int, step: int) -> list[Found]:
    """A pattern that moves by so many periods along x, picture by picture."""
    zois, field = grid(size, step), None
    x, y = pixels(SHAPE)
    kernel = PhaseKernel(picture(pattern(x, y), 0), zois, noise=NOISE_GL)
    found, here = [], centres(zois)
    for number, shift in enumerate(shifts, 1):
        u = np.full(zois.shape, shift * PERIOD)
        field = kernel.measure(picture(pattern(x - shift * PERIOD, y), number), field, noise=NOISE_GL)
        found.append(compared(field, (here[0] + u, here[1]), (u, 0 * u)))
    return found


def periods() -> Iterator[tuple[str, str, Found]]:
    """Each pattern in each motion, the worst picture of a sequence."""
    for name, pattern in PATTERNS.items():
        for motion, shifts in MOTIONS.items():
            shown = cornered(pattern) if "corner" in motion else pattern
            found = repeated(shown, shifts, 48, 24)
            yield name, motion, Found(found[0].zois, min(f.right for f in found), max(f.wrong for f in found))


# -- a block that leaps --------------------------------------------------------------------------------------------


def leaping(leap_px: float, size: int, step: int) -> Found:
    """A crack opens at once: left of it the specimen moves by ``leap_px``, the rest stays."""

    def level(x: Array, y: Array, moved: float) -> Array:
        return np.where(x < -120 - moved, SPECKLE.at(x + moved, y), np.where(x > -120, SPECKLE.at(x, y), 0.1))

    zois, (x, y) = grid(size, step), pixels(SHAPE)
    frames = [picture(level(x, y, moved), k) for k, moved in enumerate((0.0, 0.0, leap_px))]
    kernel = PhaseKernel(frames[0], zois, noise=NOISE_GL)
    field = kernel.measure(frames[2], kernel.measure(frames[1], noise=NOISE_GL), noise=NOISE_GL)
    here = centres(zois)
    u = np.where(here[0] < -120, -leap_px, 0.0)
    found = compared(field, (here[0] + u, here[1]), (u, 0 * u))
    whole = np.abs(here[0] + 120) > 0.6 * size
    stays = whole & (np.abs(here[0] + u) < SHAPE[1] / 2 - 0.75 * size)
    right = field.ok & (np.abs(field.u - u) < RIGHT_PX) & (np.abs(field.v) < RIGHT_PX)
    return Found(int(stays.sum()), float(right[stays].mean()), found.wrong)


@dataclass(frozen=True)
class Case:
    """What was found in a case, and the share that must be right; none may be wrong."""

    name: str
    found: Found
    least: float

    @property
    def holds(self) -> bool:
        """Whether it is within its limits."""
        return self.found.right >= self.least and self.found.wrong == 0


def cases(quick: bool) -> Iterator[Case]:
    """Every case; ``quick`` takes one size of ZOI."""
    for size in (48,) if quick else (32, 48, 64):
        for name, (motion, least) in JUMPS.items():
            yield Case(f"{name}, ZOI {size}", jump(motion, size, size // 2), least)
        for leap_px in (10.0, 27.0, 60.0):
            yield Case(
                f"a block leaps by {leap_px:g} px, ZOI {size}", leaping(leap_px, size, size // 2), 0.99
            )
    for name, motion, found in periods():
        yield Case(f"{name} of 9 px, {motion}, ZOI 48", found, 0.95)
    zois, number = grid(32, 8), 1 if quick else 20
    accepted = unrelated(32, 8, number)
    yield Case("unrelated pictures, ZOI 32", Found(2 * number * zois.n_active, 0.0, accepted), 0.0)
