"""The response of the places in words, for summary, report, maps and exports."""

from __future__ import annotations

import numpy as np

from live.results.maps.scale import shown_unit
from live.results.reader import Strain
from live.results.response.stored import FATE, FATES, STRESS, TIME, StoredResponse, leaves_name, slope_name


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
    beside = f", all together ± {100 * found.common:.2g} %" * (found.common > 0)
    lines = [
        f"response over {found.channel}, {found.instants} instants{_span(found)}: {name} {np.median(known):.4g}"
        f" {unit}".rstrip()
        + f" (median; 5 to 95 %: {low:.4g} to {high:.4g}), one place"
        f" ± {np.nanmedian(sigma) * factor:.2g}{beside}; chi2 {np.nanmedian(chi2):.2f}, {_side(strain, found)}"
    ]
    if np.isfinite(poisson).any():
        lines[0] += f"; Poisson {np.nanmedian(poisson):.3f}"
    return lines + _departures(strain, found)


def _departures(strain: Strain, found: StoredResponse) -> list[str]:
    leaves = leaves_name(found.channel)
    if not leaves:
        return []
    at, fate = (found.map(one)[strain.grid.active] for one in (leaves, FATE))
    unit, factor = (shown_unit(leaves)) if found.channel == STRESS else ("µm/m", 1e6)
    counts = [int(np.count_nonzero(fate == code)) for code in range(len(FATES))]
    lost = f"; lost before: {counts[2]}" * (counts[2] > 0)
    words = f"{counts[1]} of {sum(counts)} places leave their line"
    if counts[1]:
        low, middle, high = np.nanpercentile(at, (1, 50, 99)) * factor
        words += f" at {middle:.4g} {unit} (median; 1 to 99 %: {low:.4g} to {high:.4g})"
    return [words + lost]


def _span(found: StoredResponse) -> str:
    unit, factor = {STRESS: ("MPa", 1e-6), TIME: ("s", 1.0)}.get(found.channel, ("µm/m", 1e6))
    first, last = (value * factor for value in found.span)
    return f" from {first:.4g} to {last:.4g} {unit}"


def _side(strain: Strain, found: StoredResponse) -> str:
    return f"ZOI {strain.grid.size} px, VSG {found.vsg_px:.0f} px"
