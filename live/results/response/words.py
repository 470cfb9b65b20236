"""The response of the places in words, for summary, report, maps and exports."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from analysis.evaluate import Figure
from analysis.evaluate.response.departures import FIRST, WINDOW
from live.pipeline.timed.response import STRESS, TIME, leaves_name, slope_name
from live.results.maps.scale import shown_unit
from live.results.quantities import quantity_of
from live.results.reader import Strain
from live.results.response.stored import FATE, StoredResponse


def response_title(strain: Strain, name: str) -> str:
    """Name, channel, instants, ZOI and VSG of a map of the whole test; empty for others."""
    found = strain.response
    if found is None or name not in found.names:
        return ""
    return f"{name} over {found.channel}, {found.instants} instants, {_side(strain, found)}"


def response_lines(strain: Strain) -> list[str]:
    """What the places did, and where they left their lines; nothing without a response."""
    found = strain.response
    if found is None:
        return []
    name = slope_name(found.channel)
    unit, factor = shown_unit(name)
    slope, sigma, chi2, poisson = (
        found.map(one)[strain.grid.active] for one in (name, f"sigma_{name}", "chi2", "poisson")
    )
    known = slope[np.isfinite(slope)] * factor
    if not known.size:
        return [f"response over {found.channel}: no place has one in {found.instants} instants"]
    low, high = np.percentile(known, (5, 95))
    # A strain that all places have in common is in that of the channel too.
    of = " of the distance from 1" * (name == "amplification")
    beside = f", all together ± {100 * found.common:.2g} %{of}" * (found.common > 0)
    value = f"{name} {np.median(known):.4g} {unit}".rstrip()
    across = f"; Poisson {np.nanmedian(poisson):.3f}" if np.isfinite(poisson).any() else ""
    return [
        f"response over {found.channel}, {found.instants} instants{_span(found)}: {value} (median; 5 to 95 %: {low:.4g}"
        f" to {high:.4g}), one place ± {np.nanmedian(sigma) * factor:.2g}{beside}; chi2 {np.nanmedian(chi2):.2f},"
        f" {_side(strain, found)}{across}",
        *_departures(strain, found),
    ]


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
    at, fate = (found.map(one)[strain.grid.active] for one in (leaves, FATE))
    unit, factor = shown_unit(leaves) if found.channel == STRESS else ("µm/m", 1e6)
    _, left, lost = (int(np.count_nonzero(fate == code)) for code in range(3))
    if not left and found.instants < FIRST + WINDOW:
        return [f"where places leave their lines is not known: that takes {FIRST + WINDOW} instants"]
    words = f"{left} of {np.isfinite(fate).sum()} places leave their line"
    if left:
        low, middle, high = np.nanpercentile(at, (1, 50, 99)) * factor
        words += f" at {middle:.4g} {unit} (median; 1 to 99 %: {low:.4g} to {high:.4g})"
    return [words + f"; lost before: {lost}" * (lost > 0)]


def _span(found: StoredResponse) -> str:
    unit, factor = {STRESS: ("MPa", 1e-6), TIME: ("s", 1.0)}.get(found.channel, ("µm/m", 1e6))
    first, last = found.first * factor, found.last * factor
    return f" from {first:.4g} to {last:.4g} {unit}"


def _side(strain: Strain, found: StoredResponse) -> str:
    return f"ZOI {strain.grid.size} px, VSG {found.vsg_px:.0f} px"
