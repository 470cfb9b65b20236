"""What to change for a strain noise that is asked for: larger ZOIs, longer bursts, more light."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from acquire.text import Message
from acquire.text.message import joined
from live.setup.check.check_list import CheckFigures
from live.setup.check.noise_floor import ZoiFloor

FULL_LIGHT = 0.95  # of full scale: more light saturates
MAX_BURST = 1000


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
        return joined("; ", ways)
    if not figures.floors:
        return Message("the table of phasedic check shows what reaches it")
    return Message(
        "nothing here reaches it: more contrast, a finer pattern, a closer or quieter camera, more light"
    )


def _ways(figures: CheckFigures, target: float) -> Iterator[str]:
    now = figures.floor
    for floor, burst in reaching(figures.floors, target):
        same_zoi, same_burst = floor.zoi == figures.zoi, burst == figures.burst
        order = "" if floor.order == figures.order else Message(" of order {order}", floor.order)
        if same_zoi:
            yield Message("burst {burst}{order}", burst, order)
        elif same_burst or burst < figures.burst:
            yield Message("ZOI {zoi}{order}", floor.zoi, order)
            break
        else:
            yield Message("ZOI {zoi}{order} and burst {burst}", floor.zoi, order, burst)
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
        yield Message("burst {number} with ZOI {zoi}", math.ceil(1 / rest), floor.zoi)
    elif 2 * one / target**2 < MAX_BURST:
        both = math.ceil(2 * one / target**2)
        yield Message("burst {both} and a reference of {both} with ZOI {zoi}", both, floor.zoi)


def _more_light(figures: CheckFigures, factor: float) -> str:
    """More light or contrast; with shot noise, twice the light gives 1.4 times the signal-to-noise ratio."""
    possible = FULL_LIGHT / max(figures.exposure.high, 1e-3)
    times = Message("twice") if 1.8 < factor < 2.2 else Message("{factor:.1f} times", factor)
    if factor <= possible:
        return Message("{times} the light or exposure", times)
    need = math.sqrt(factor / max(possible, 1.0))
    return Message(
        "{need:.1f} times the contrast (light helps {possible:.1f} times, then it saturates)", need, possible
    )
