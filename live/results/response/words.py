"""The response of the places in words, for summary, report, maps and exports."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from acquire.text import Message
from acquire.text.message import word
from analysis.evaluate import Figure
from analysis.evaluate.response.departures import FIRST, WINDOW
from live.pipeline.timed.response import CHANNELS, STRESS, TIME, leaves_name, slope_name
from live.results.maps.scale import shown_unit
from live.results.quantities import quantity_of
from live.results.reader import Strain
from live.results.response.stored import FATE, StoredResponse


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
