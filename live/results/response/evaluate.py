"""The response of each place from the maps of a finished ``strain.h5``, which has the group for it.

Its instants are read one by one: for where places leave their lines, then for the lines up to there.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquire.errors import DataError
from analysis.evaluate import Figure, TensileFigures
from analysis.evaluate.response.departures import NOT_USED, Departures
from analysis.evaluate.response.lines import ResponseSums
from analysis.picture.pattern import gauge_length
from live.pipeline.timed.response import MEAN, STRESS, TIME, leaves_name, slope_name
from live.results.reader import Strain
from live.results.response.rising import Channel
from live.results.response.stored import FATE, fill_group, read_noise
from live.results.response.words import response_figures, response_lines
from live.results.run_folder import STRAIN, RunFolder, open_run
from live.results.stored_fields import window_of

Floats = NDArray[np.float64]
UP_TO = 0.9
"""Of where a place leaves its line, its line ends: the last instants before that is seen may be off already."""
_OF_STRAIN = ("strain", "lens", "blur", "film")  # causes in the budget of E that do not come with the stress


def response_of(
    folder: Path, figures: TensileFigures, channel: str
) -> tuple[list[str], list[tuple[str, Figure, str]]]:
    """``respond`` for a test that has just ended; what was found, or why nothing was, for summary and figures.json."""
    try:
        respond(folder, figures, channel)
        with Strain.open(folder / STRAIN) as strain:
            return response_lines(strain), [*response_figures(strain)]
    except DataError as error:
        return [f"no response over {channel}: {error}"], []


def respond(folder: Path, figures: TensileFigures, channel: str) -> None:
    """Evaluate the test in ``folder`` over ``channel``, and fill the group ``response`` of its ``strain.h5``.

    Raises
    ------
    DataError
        Its files cannot be read or written, or the load rises at too few instants.
    """
    with open_run(folder) as run:
        maps, about = _Places(run, Channel.of(run, figures, channel)).evaluated()
    shares = [s for cause, s in figures.budget.items() if cause in _OF_STRAIN or channel == STRESS]
    common = 0.0 if channel == TIME else math.hypot(*shares[channel == STRESS :])
    fill_group(folder / STRAIN, maps, about | {"common": common})


class _Places:
    """The places of a run over a channel."""

    def __init__(self, run: RunFolder, over: Channel) -> None:
        self._strain, self._along, self._across, self._over = run.strain, run.axial, run.transverse, over
        share, self._correlations = read_noise(run.strain.path, run.strain.n, run.strain.grid.shape)
        self._own = np.sqrt(share)
        self._references = [run.strain.reference(int(k)) for k in over.rows]

    def _maps(self, row: int, *names: str) -> Iterator[Floats]:
        """Value and sigma of each strain at an instant, without the noise of the reference."""
        for name in names:
            yield np.asarray(self._strain.maps(name, row), np.float64)
            yield np.asarray(self._strain.maps(f"sigma_{name}", row), np.float64) * self._own[row]

    def _departures(self, *channels: Floats) -> list[Departures]:
        """Where places leave their lines over each of ``channels``, (T,)."""
        found = [Departures(self._strain.grid.shape, len(self._over.rows)) for _ in channels]
        for row, reference in zip(self._over.rows.tolist(), self._references, strict=True):
            y, sigma = self._maps(row, self._along)
            for one, x in zip(found, channels, strict=True):
                one.add(float(x[row]), y, sigma, reference or 0)
        return found

    def evaluated(self) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
        """The maps, and what holds for all of them."""
        over, leaves = self._over, leaves_name(self._over.name)
        x = [over.x] if over.stress is None or over.name == STRESS else [over.x, over.stress]
        found = self._departures(*x)
        segments = found[0].segments if leaves else [one or 0 for one in self._references]
        slope, poisson, used = ResponseSums(), ResponseSums(), []
        for row, segment, reference in zip(over.rows.tolist(), segments, self._references, strict=True):
            if segment == NOT_USED:
                continue
            y, s_y, z, s_z = self._maps(row, self._along, self._across)
            for values, one in zip(x, found if leaves else [], strict=False):
                y = np.where(np.abs(values[row]) > UP_TO * np.abs(one.at), np.nan, y)
            if not np.isfinite(y).any():
                continue
            used.append(float(over.x[row]))
            # The noise of the mean is in each of its places; of a gauge it is not known in which.
            s_x = over.sigma[row] * self._own[row]
            both = 0.0 if reference is None else self._correlations[reference]
            slope += ResponseSums.of(over.x[row], y, s_y, segment, s_x, s_x**2 * (over.name == MEAN))
            poisson += ResponseSums.of(y, z, s_z, segment, s_y, both * s_y * s_z)
        if not used:
            raise DataError("the load rises at {n} of {of} instants", len(over.rows), self._strain.n)
        lines, beside, name = slope.lines(), poisson.lines(), slope_name(over.name)
        fates = np.where(np.isfinite(found[0].at) & bool(leaves), 1, np.where(found[0].seen, 0, 2))
        maps: dict[str, NDArray[Any]] = {
            name: lines.slope, f"sigma_{name}": lines.sigma, "chi2": lines.chi2, "instants": lines.n,
            "poisson": -beside.slope, "sigma_poisson": beside.sigma,
            **({leaves: found[0].at} if leaves else {}), FATE: np.where(lines.n > 0, fates, np.nan),
        }  # fmt: skip
        side = gauge_length(self._strain.grid.size, window_of(self._strain))
        return maps, {
            "strain": self._along, "instants": int(lines.n.max()), "first": used[0], "last": used[-1], "vsg_px": side,
        }  # fmt: skip
