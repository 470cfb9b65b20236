"""What reaches a strain noise that is asked for, or what is missing, in words of the bench."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from live.check.figures import Figures
from live.check.floor import Floor

FULL = 0.95  # of the scale: more light than that saturates
MOST_BURST = 1000


def reaching(floors: Sequence[Floor], target: float) -> list[tuple[Floor, int]]:
    """For each ZOI the shortest burst, and the lower order, whose noise is at most ``target``."""
    found: dict[int, tuple[Floor, int]] = {}
    for floor in floors:
        for noise in floor.noises:
            best = found.get(floor.zoi)
            if noise.known <= target and (best is None or noise.burst < best[1]):
                found[floor.zoi] = (floor, noise.burst)
    return [found[zoi] for zoi in sorted(found)]


def advice(figures: Figures, target: float) -> str:
    """What to change so that one ZOI has at most the strain noise ``target`` (dimensionless)."""
    ways = list(_ways(figures, target))
    if ways:
        return ", or ".join(ways)
    if not figures.floors:
        return "the table of the whole check says what reaches it"
    return "nothing here reaches it: more contrast, a finer pattern, a closer or quieter camera, more light"


def _ways(figures: Figures, target: float) -> Iterator[str]:
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
    yield _light(figures, (noise.known / target) ** 2)


def _longer(floor: Floor, burst: int, noise: float, target: float) -> Iterator[str]:
    """A burst that is not in the table; the noise of the reference sets a limit to it."""
    one = noise**2 / (1 / floor.reference + 1 / burst)
    rest = target**2 / one - 1 / floor.reference
    if rest > 1 / MOST_BURST:
        yield f"burst {math.ceil(1 / rest)} with ZOI {floor.zoi}"
    elif 2 * one / target**2 < MOST_BURST:
        both = math.ceil(2 * one / target**2)
        yield f"burst {both} and a reference of {both} with ZOI {floor.zoi}"


def _light(figures: Figures, factor: float) -> str:
    """Shot noise: twice the light, 1.4 times the signal-to-noise."""
    room = FULL / max(figures.exposure.high, 1e-3)
    times = "twice" if 1.8 < factor < 2.2 else f"{factor:.1f} times"
    if factor <= room:
        return f"{times} the light or exposure"
    need = math.sqrt(factor / max(room, 1.0))
    return f"{need:.1f} times the contrast (light helps {room:.1f} times, then it saturates)"
