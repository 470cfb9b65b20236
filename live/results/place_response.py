"""The response of each place from the maps of a finished ``strain.h5``, which has the group for it.

It is over a channel of the run, at the instants that count. These are read one by one: for where places leave their
lines, then for the lines up to there. Summary, report, maps and exports have it in words from here.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquire.errors import ConfigError, DataError
from acquire.text import Message, word
from analysis.evaluate import Curve, Figure, TensileFigures
from analysis.evaluate.curve import Loading
from analysis.evaluate.programme import KindOfTest
from analysis.evaluate.response import FIRST, NOT_USED, WINDOW, Departures, ResponseSums
from analysis.picture.pattern import gauge_length
from live.config.loading import Config
from live.pipeline.timed.course import CHANNELS, MEAN, STRESS, TIME, leaves_name, slope_name
from live.results.layout import gauge_columns
from live.results.maps.scale import shown_unit
from live.results.quantities import quantity_of
from live.results.reader import Strain
from live.results.run_folder import STRAIN, RunFolder, open_run
from live.results.stored_fields import window_of
from live.results.stored_response import FATE, StoredResponse, fill_group, read_noise

Floats = NDArray[np.float64]

UP_TO = 0.9
"""Of where a place leaves its line, its line ends: the last instants before that is seen may be off already."""
_OF_STRAIN = ("strain", "lens", "blur", "film")  # causes in the budget of E that do not come with the stress


def response_title(strain: Strain, name: str) -> str:
    """Name, channel, instants, ZOI and VSG of a map of the whole test; empty for others."""
    found = strain.response
    if found is None or name not in found.names:
        return ""
    side = _side(strain, found)
    return Message("{name} over {channel}, {n} instants, {side}", name, _channel(found), found.instants, side)


def _channel(found: StoredResponse) -> str:
    return word(found.channel) if found.channel in CHANNELS else found.channel


def response_lines(strain: Strain) -> list[str]:
    """What the places did, and where they left their lines; nothing without a response."""
    found = strain.response
    if found is None:
        return []
    name = slope_name(found.channel)
    unit, factor = shown_unit(name)
    slope, sigma, chi2, poisson = (
        found.map(one)[strain.grid.active].astype(np.float64)
        for one in (name, f"sigma_{name}", "chi2", "poisson")
    )
    known = slope[np.isfinite(slope)] * factor
    if not known.size:
        none = Message(
            "response over {channel}: no place has one in {n} instants", _channel(found), found.instants
        )
        return [none]
    low, high = np.percentile(known, (5, 95))
    # A strain that all places have in common is in that of the channel too.
    of = Message(" of the distance from 1") * (name == "amplification")
    beside = Message(", all together ± {share:.2g} %{of}", 100 * found.common, of) * (found.common > 0)
    known_across = np.isfinite(poisson).any()
    across = Message("; Poisson {ratio:.3f}", np.nanmedian(poisson)) if known_across else ""
    first = Message(
        "response over {channel}, {n} instants{span}: {name} {median:.4g}{unit} (median; 5 to 95 %: {low:.4g} to "
        "{high:.4g})",
        _channel(found), found.instants, _span(found), word(name), np.median(known), f" {unit}".rstrip(), low, high,
    )  # fmt: skip
    then = Message(
        ", one place ± {sigma:.2g}{beside}; chi2 {chi2:.2f}, {side}{across}",
        np.nanmedian(sigma) * factor, beside, np.nanmedian(chi2), _side(strain, found), across,
    )  # fmt: skip
    return [first + then, *_departures(strain, found)]


def response_figures(strain: Strain) -> Iterator[tuple[str, Figure, str]]:
    """Name, figure and SI unit of what other programs get: the median, and where 95 % of the places are."""
    found = strain.response
    if found is None:
        return
    for name in filter(None, (slope_name(found.channel), leaves_name(found.channel))):
        known = found.map(name)[strain.grid.active]
        known = known[np.isfinite(known)]
        none = Figure.none("no place has a value")
        figure = Figure(*np.percentile(known, (50, 2.5, 97.5)).tolist()) if known.size else none
        yield f"{name} of the places", figure, quantity_of(name).unit or "1"
    left = float(np.count_nonzero(found.map(FATE)[strain.grid.active] == 1))
    yield "places that leave their line", Figure(left, left, left), "1"


def _departures(strain: Strain, found: StoredResponse) -> list[str]:
    leaves = leaves_name(found.channel)
    if not leaves:
        return []
    at, fate = (found.map(one)[strain.grid.active].astype(np.float64) for one in (leaves, FATE))
    unit, factor = shown_unit(leaves) if found.channel == STRESS else ("µm/m", 1e6)
    _, left, lost = (int(np.count_nonzero(fate == code)) for code in range(3))
    if not left and found.instants < FIRST + WINDOW:
        return [
            Message("where places leave their lines is not known: that takes {n} instants", FIRST + WINDOW)
        ]
    words = Message("{left} of {places} places leave their line", left, np.isfinite(fate).sum())
    if left:
        low, middle, high = np.nanpercentile(at, (1, 50, 99)) * factor
        words += Message(
            " at {middle:.4g} {unit} (median; 1 to 99 %: {low:.4g} to {high:.4g})", middle, unit, low, high
        )
    return [words + Message("; lost before: {lost}", lost) * (lost > 0)]


def _span(found: StoredResponse) -> str:
    unit, factor = {STRESS: ("MPa", 1e-6), TIME: ("s", 1.0)}.get(found.channel, ("µm/m", 1e6))
    first, last = found.first * factor, found.last * factor
    return Message(" from {first:.4g} to {last:.4g} {unit}", first, last, unit)


def _side(strain: Strain, found: StoredResponse) -> str:
    return Message("ZOI {size} px, VSG {vsg:.0f} px", strain.grid.size, found.vsg_px)


@dataclass(frozen=True, slots=True, eq=False)
class Channel:
    """What the strains of the places are held against.

    Attributes
    ----------
    name : str
    x, sigma : (T,) float64
        With its noise: Pa, 1 or s.
    stress : (T,) float64 or None
        Where it is known: the places are elastic only up to where they leave their lines over it.
    rows : (K,) int
        The instants that count.
    """

    name: str
    x: Floats
    sigma: Floats
    stress: Floats | None
    rows: NDArray[np.intp]

    @classmethod
    def of(cls, run: RunFolder, figures: TensileFigures, name: str) -> Channel:
        """The channel ``name`` of a run with its ``figures``."""
        values, nothing = run.strain.values, np.zeros(run.strain.n)
        if name == TIME:
            return cls(name, run.strain.time_s, nothing, None, np.flatnonzero(np.isfinite(run.strain.time_s)))
        curve = run.curve
        loaded = bool(np.isfinite(curve.stress).any())
        if name == STRESS:
            x, sigma = curve.stress, nothing
        else:
            columns = (run.axial, f"sigma_{run.axial}") if name == MEAN else gauge_columns(name)[:2]
            x, sigma = (np.asarray(values[column], np.float64) for column in columns)
        if not loaded:
            curve = replace(curve, strain=x, stress=x)
        rows = _rising(curve, figures, run.specimen.test)
        return cls(name, x, sigma, curve.stress if loaded else None, rows[np.isfinite(x[rows])])


def _rising(curve: Curve, figures: TensileFigures, test: str) -> NDArray[np.intp]:
    """The instants at which the load rises as for E: by the same envelope, from where its interval begins."""
    programme = KindOfTest.of(curve, test)
    if programme.why:
        curve = programme.first_rise(curve)
    known = curve.stress[np.isfinite(curve.stress)]
    if known.size and -known.min() > known.max():
        curve = replace(curve, strain=-curve.strain, stress=-curve.stress)
    loading, first = Loading.of(curve), 0
    if figures.span is not None and loading.n:
        first = int(np.argmax(loading.level >= figures.span.stress[0]))
    return np.flatnonzero(np.isin(curve.t, loading.t[first : loading.top + 1]))


def check_channel(config: Config, *, forces: bool) -> None:
    """Refuse a channel that the test will not have; ``forces``: there are any.

    Raises
    ------
    ConfigError
    """
    name = config.output.response or ""
    if name == STRESS and not (forces and config.specimen.area_m2):
        what = Message("a section (--section W,T)") if forces else Message("forces (--load FILE.csv)")
        raise ConfigError("--response stress needs {what}; --response mean needs neither", what)
    if name not in ("", *CHANNELS, *config.gauges):
        known = ", ".join((*CHANNELS, *config.gauges))
        raise ConfigError("--response {name}: there is no such gauge; give one of {known}", name, known)


def response_of(
    folder: Path, figures: TensileFigures, channel: str
) -> tuple[list[str], list[tuple[str, Figure, str]]]:
    """``respond`` for a test that has just ended; what was found, or why nothing was, for summary and figures.json."""
    try:
        respond(folder, figures, channel)
        with Strain.open(folder / STRAIN) as strain:
            return response_lines(strain), [*response_figures(strain)]
    except DataError as error:
        return [Message("no response over {channel}: {why}", channel, error.text)], []


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
