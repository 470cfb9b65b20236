"""Which ZOIs are valid: a status for each from its own numbers, in a compiled loop.

The limits are in ``validity``.
"""

from __future__ import annotations

import math
from typing import Any

from analysis.compiled.loops import helper, inlined
from analysis.field import Status
from analysis.fit.assembly import MIN_NOISE_GAIN
from analysis.fit.kernel_args import CONVERGED, LEFT_IMAGE, OutArgs, PooledError, ReferenceArgs, VerdictArgs
from analysis.fit.validity import (
    AGREES,
    BENDING_CHANCE,
    BENDING_SHARE,
    CHANCE,
    COLOURED,
    CORNER_SIGMA,
    CORNER_VARIANCE,
    EMPTY_SHARES,
    EMPTY_SIGMA,
    INFORMATION_OVER_NOISE,
    LOST_SHARE,
    MANY_STEPS,
    MAX_GAIN,
    MIN_GAIN,
    MODEL_SHARE,
    NOISE_FACTOR,
    POOLED_NOISE_FACTOR,
    QUIETER,
    SLOW_SIGMA,
    UNKNOWN_NOISE_FACTOR,
)

OK, OUTSIDE, LOST, UNEVEN = int(Status.OK), int(Status.OUTSIDE), int(Status.LOST), int(Status.UNEVEN)
NOT_CONVERGED, POOR_MATCH = int(Status.NOT_CONVERGED), int(Status.POOR_MATCH)
NO_PATTERN = int(Status.NO_PATTERN)


@helper
def judge(
    found: OutArgs, left: Any, expected: Any, common: PooledError, known: ReferenceArgs, rule: VerdictArgs, out: Any
) -> None:  # fmt: skip
    """Write a status for each measured ZOI.

    Parameters
    ----------
    found : OutArgs
        Of the iteration.
    left, expected : (A,), GL^2
        Variance a pixel that the fit leaves, and expected from the noise of both images as stated.
    common : PooledError
        A ZOI that leaves no more than its like is not refused for it.
    known : ReferenceArgs
    rule : VerdictArgs
    out : (A,) uint8, written
    """
    colour = max(common.colour[0], common.colour[1])
    if colour < COLOURED:
        colour = 1.0
    for z in range(len(out)):
        gain = found.nuisance[z, 0]
        spread = math.sqrt(2 / max(known.pixels[z], 1.0))
        chance = NOISE_FACTOR + CHANCE * spread
        if not rule.noise_known:
            chance = max(chance, UNKNOWN_NOISE_FACTOR if common.scatter == 0 else POOLED_NOISE_FACTOR)
            chance *= min(common.ratio[z], 1.0)
        pattern = known.signal[z] * min(gain, 1.0) ** 2
        error = common.forgiven[z] * expected[z]
        noise = min(expected[z], max(error, AGREES[0] * expected[z])) if rule.noise_known else expected[z]
        allowed = chance * noise
        if common.forgiven[z] > 1:
            usual = error * (NOISE_FACTOR + CHANCE * max(common.scatter, spread))
            allowed = max(allowed, min(usual, LOST_SHARE * pattern))
        if found.state[z] == LEFT_IMAGE:
            out[z] = OUTSIDE
        elif not left[z] <= allowed + LOST_SHARE * pattern:
            out[z] = LOST
        elif found.state[z] != CONVERGED or _slow(found, z, known, expected[z], rule):
            out[z] = NOT_CONVERGED
        elif _is_empty(known, z, left[z], expected[z], error) or _is_noise(known, z, left[z], expected[z]):
            out[z] = NO_PATTERN
        elif not (MIN_GAIN < gain < MAX_GAIN and left[z] <= allowed + MODEL_SHARE * pattern):
            out[z] = POOR_MATCH
        else:
            by_noise = NOISE_FACTOR * max(noise, error) if rule.noise_known else allowed
            misfit = _used(left[z], by_noise, allowed + MODEL_SHARE * pattern - by_noise)
            many = colour if common.forgiven[z] > 1 else 1.0
            variance = max(noise, left[z]) / max(gain, MIN_NOISE_GAIN) ** 2
            bent = _bent(found, z, known, variance, common.bent, many, rule)
            doubt = (misfit + bent) * _beyond(known, z, rule.far)
            out[z] = OK if doubt <= 1 else POOR_MATCH if misfit > bent else UNEVEN


@inlined
def _sigma(known: Any, z: int, variance: Any) -> Any:
    """Uncertainty of the worse of u and v of ZOI ``z`` if nothing else were sought, px."""
    return math.sqrt(max(known.unit[z, 0], known.unit[z, 1]) * variance)


@inlined
def _is_empty(known: Any, z: int, left: Any, expected: Any, error: Any) -> Any:
    """Whether there was nothing to fit."""
    least = min(expected, error)
    little = EMPTY_SHARES[0] * least < left < EMPTY_SHARES[1] * least
    return little and _sigma(known, z, expected) > EMPTY_SIGMA


@inlined
def _is_noise(known: Any, z: int, left: Any, expected: Any) -> Any:
    """Whether u, v or a gradient follows the noise of the reference, which is less where the ZOI leaves less."""
    if known.information[z] >= INFORMATION_OVER_NOISE:
        return False
    by_chance = NOISE_FACTOR + QUIETER * math.sqrt(2 / max(known.pixels[z], 1.0))
    return known.information[z] * expected / (left * by_chance) < INFORMATION_OVER_NOISE


@inlined
def _slow(found: Any, z: int, known: Any, variance: Any, rule: Any) -> Any:
    """Whether a fit took so many small steps that it may have been led away: along a weak pattern, or by a corner.

    A corner looks alike at every scale; its fit is slow although it is certain.
    """
    sigma, steps = known.centre[z] * math.sqrt(variance), found.iterations[z]
    if steps >= MANY_STEPS and sigma > SLOW_SIGMA:
        return True
    return steps >= rule.corner_steps and sigma < CORNER_SIGMA and _beyond(known, z, CORNER_VARIANCE) > 1


@inlined
def _used(value: Any, by_noise: Any, margin: Any) -> Any:
    """The share of the margin beyond what noise makes that a value takes; not less than 0."""
    share = (value - by_noise) / margin
    return 0.0 if share < 0 else share


@inlined
def _bent(found: Any, z: int, known: Any, variance: Any, bent: Any, colour: Any, rule: Any) -> Any:
    """How far the displacement bends or jumps, in shares of what is allowed; beyond 1 the centre is wrong.

    The displacement that the strain makes over the width of the window allows for more: where a
    specimen necks the strain is steep, but small beside itself; across a crack it is not. What all bend, ``bent``
    times white noise, counts as noise, as far as it is coloured or within the limit.
    """
    of_u, of_v = variance * known.unit[z, 0], variance * known.unit[z, 1]
    white = (of_u + of_v) * rule.noise[0]
    many = max(colour, min(bent, 1 + rule.limit**2 / max(white, 1e-12)))
    spread = math.sqrt(2 * rule.noise[1] * (of_u**2 + of_v**2))
    allowed = rule.limit**2 + BENDING_SHARE**2 * squared_stretch(found.p, z, rule.lever)
    return _used(found.bending[z], many * white, BENDING_CHANCE * many * spread + allowed)


@inlined
def _beyond(known: Any, z: int, far: Any) -> Any:
    """How much more counts what is left because the centre lies beyond its pattern; 1 as a rule."""
    return max(1.0, known.centre[z] ** 2 / (far * max(known.unit[z, 0], known.unit[z, 1])))


@helper
def squared_stretch(values: Any, z: int, lever: Any) -> Any:
    """Square of the magnitude of the Green-Lagrange strain of ZOI ``z`` times ``lever`` px."""
    half = values.shape[1] // 2
    du_dx, du_dy = values[z, 1], values[z, 2]
    dv_dx, dv_dy = values[z, half + 1], values[z, half + 2]
    xx = du_dx + (du_dx**2 + dv_dx**2) / 2
    yy = dv_dy + (du_dy**2 + dv_dy**2) / 2
    xy = (du_dy + dv_dx + du_dx * du_dy + dv_dx * dv_dy) / 2
    return lever**2 * (xx**2 + yy**2 + 2 * xy**2)
