"""Gauges read one by one, over the whole grid, with numpy alone: what the pass over all gauges is compared with."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from analysis import Status, StrainField
from analysis.evaluate import AreaStrain, Gauge, facing
from analysis.evaluate.area_strain import GRADIENTS
from analysis.field import PAIR_INDEX, variance_of_sum
from analysis.field.part import BLOCK_SHARE, MIN_BLOCK, in_blocks

Mask = NDArray[np.bool_]
Value = tuple[float, float, float]
NOTHING = (math.nan, math.nan)


def alone(gauge: Gauge, field: StrainField) -> Value:
    """Value, sigma and share of the area."""
    ends, how = gauge.zois(field.grid), gauge.reading
    value = _strips(ends, field, how.along) if how.statistic == "ends" else _area(gauge, ends[0], field)
    return *value, gauge.share(field.grid) * min(_share(end, field) for end in ends)


def _enough(chosen: Mask, field: StrainField) -> bool:
    return bool(chosen.any()) and np.count_nonzero(chosen & field.ok) >= 0.5 * np.count_nonzero(chosen)


def _share(chosen: Mask, field: StrainField) -> float:
    able = chosen & ~np.isin(field.status, (Status.NOT_MEASURED, Status.NO_PATTERN))
    lost, count = able & ~field.ok, np.count_nonzero(able)
    least = max(1, min(MIN_BLOCK, round(BLOCK_SHARE * count)))
    return 1 - np.count_nonzero(lost) / count if in_blocks(lost, least).any() else 1.0


def _area(gauge: Gauge, chosen: Mask, field: StrainField) -> tuple[float, float]:
    how = gauge.reading
    if not _enough(chosen, field):
        return NOTHING
    if how.statistic == "affine" and how.value in GRADIENTS:
        area = AreaStrain.of(field, chosen)
        return NOTHING if area is None else (area.value(how.value), area.sigma(how.value))
    if how.statistic in ("affine", "mean"):
        return field.mean(how.value, chosen)
    sign = 1 if how.statistic == "largest" else -1
    values = np.where(chosen & field.ok, sign * field.value(how.value), -np.inf)
    k = np.unravel_index(int(np.argmax(values)), values.shape)
    return float(sign * values[k]), float(field.sigma(how.value)[k])


def _strips(ends: Sequence[Mask], field: StrainField, along: str) -> tuple[float, float]:
    if not all(_enough(end, field) for end in ends):
        return NOTHING
    if along and facing(ends, along) is not None:
        side = 1 if along == "x" else 0
        first, second = ((end & field.ok).any(axis=side, keepdims=True) for end in ends)
        ends = [end & first & second for end in ends]
    ends = [end & field.ok for end in ends]
    return _extension(ends, field) if all(end.any() for end in ends) else NOTHING


def _extension(ends: Sequence[Mask], field: StrainField) -> tuple[float, float]:
    share = ends[1] / ends[1].sum() - ends[0] / ends[0].sum()
    x, y = np.meshgrid(field.grid.x, field.grid.y)
    before, moved = (
        np.array([np.sum(np.where(share != 0, share * values, 0)) for values in pair])
        for pair in ((x, y), (field.u, field.v))
    )
    length, now = np.hypot(*before), np.hypot(*(before + moved))
    if not length > 0:
        return NOTHING
    nx, ny = (before + moved) / now
    uu, uv, vv = (field.covariance[PAIR_INDEX[pair]].astype(float) for pair in ((0, 0), (0, 3), (3, 3)))
    spread = np.sqrt(np.maximum(nx * nx * uu + 2 * nx * ny * uv + ny * ny * vv, 0))
    spread = np.where(share != 0, share * spread, 0)
    variance = variance_of_sum(spread, "u", field.grid, field.window)
    if field.common is not None:
        along = np.zeros((6, *field.grid.shape))
        along[0], along[3] = nx * share, ny * share
        variance += field.common.variance_of_sum(along)
    return float(moved @ (2 * before + moved) / (now + length) / length), math.sqrt(variance) / length
