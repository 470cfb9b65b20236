"""The group ``response`` of ``strain.h5``: made with the file where it is asked for, filled when the test is over.

A file that was left before that holds it empty, and is read as one without.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquire.errors import DataError
from acquire.hdf5 import (
    Declared,
    as_text,
    new_group,
    open_dataset,
    open_datasets,
    open_file,
    open_group,
    read_attribute,
    reason,
    storable,
)
from acquire.printable import printable
from live.results.quantities import quantity_of

GROUP, CURRENT, CORRELATION, FATE = "response", "current", "correlation", "fate"
STRESS, MEAN, TIME = "stress", "mean", "time"
CHANNELS = (STRESS, MEAN, TIME)
"""What a strain may be held against, besides a gauge by its name."""
FATES = ("on its line to the end", "left its line", "lost before the end")
_SLOPES = {STRESS: "compliance", TIME: "rate"}
ATTRIBUTES = {
    "channel": Declared("text"), "strain": Declared("text"), "instants": Declared("int", (), 0),
    "first": Declared("f8"), "last": Declared("f8"), "common": Declared("f8", (), 0), "vsg_px": Declared("f8", (), 0),
}  # fmt: skip


def slope_name(channel: str) -> str:
    """Of the map of slopes over ``channel``: compliance, rate or amplification."""
    return _SLOPES.get(channel, "amplification")


def leaves_name(channel: str) -> str:
    """Of the map of where places leave their lines; empty over time."""
    return "" if channel == TIME else "leaves_at_stress" if channel == STRESS else "leaves_at_strain"


def map_names(channel: str) -> tuple[str, ...]:
    """All maps over ``channel``."""
    slope, leaves = slope_name(channel), leaves_name(channel)
    first = (slope, f"sigma_{slope}", "chi2", "instants", "poisson", "sigma_poisson")
    return (*first, *((leaves,) if leaves else ()), FATE)


def declared(channel: str, shape: tuple[int, int]) -> dict[str, Declared]:
    """What each map must be."""
    return {name: Declared("f4", shape) for name in map_names(channel)}


def add_group(entry: Any, channel: str, shape: tuple[int, int]) -> None:
    """Make the group, without values, after ``strain``."""
    group = new_group(
        entry, GROUP, "NXdata", signal=slope_name(channel), title=f"Response of each place over {channel}"
    )
    group.attrs["axes"] = ["y", "x"]
    group.attrs.update(
        channel=np.bytes_(storable(channel).encode()), strain=np.array("", "S3"), instants=np.int64(0)
    )
    group.attrs.update(dict.fromkeys(("first", "last"), np.float64(np.nan)))
    group.attrs.update(dict.fromkeys(("common", "vsg_px"), np.float64(0)))
    for name, what in declared(channel, shape).items():
        dataset = group.create_dataset(
            name, shape, what.dtype, chunks=shape, fletcher32=True, fillvalue=np.nan
        )
        quantity = quantity_of(name)
        dataset.attrs.update(units=quantity.unit, long_name=quantity.words)
    for name in ("x", "y"):
        group[name] = entry[f"strain/{name}"]
    for name, sizes, chunks, words in (
        (
            CURRENT,
            (),
            (256,),
            "share of the variance of a strain at each instant that is not of the reference",
        ),
        (CORRELATION, shape, (1, *shape), "correlation of the noises of exx and eyy against each reference"),
    ):
        dataset = group.create_dataset(
            name, (0, *sizes), "f4", maxshape=(None, *sizes), chunks=chunks, fletcher32=True
        )
        dataset.attrs.update(units="", long_name=words)


def read_noise(path: Path, n: int, shape: tuple[int, int]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """What the writer noted: share of the variance of strains that is not of the reference at each instant, (n,), 1
    where it is not known, and correlation of the noises of exx and eyy against each reference, (J, R, C)."""
    with open_file(path) as file:
        group = file["entry"][GROUP]
        held = open_dataset(group, CURRENT, Declared("f4", (None,)))[:n].astype(np.float64)
        both = open_dataset(group, CORRELATION, Declared("f4", (None, *shape)))[()].astype(np.float64)
    share = np.pad(held, (0, n - len(held)), constant_values=np.nan)
    return np.where((share > 0) & (share <= 1), share, 1.0), np.where(np.abs(both) < 1, both, 0.0)


def fill_group(path: Path, maps: Mapping[str, NDArray[Any]], about: Mapping[str, Any]) -> None:
    """Put the values into the group of a file that is closed.

    Raises
    ------
    DataError
        It cannot be written.
    """
    try:
        with open_file(path, "r+", libver=("v110", "v110")) as file:
            group = file["entry"][GROUP]
            for name, values in maps.items():
                group[name][...] = values
            for name, value in about.items():
                kept = group.attrs[name]
                group.attrs.modify(name, np.asarray(value, kept.dtype))
    except (OSError, RuntimeError, KeyError) as error:
        raise DataError(f"{path}: the response cannot be written ({reason(error)})") from error


@dataclass(frozen=True, slots=True, eq=False)
class StoredResponse:
    """What each place did over all instants.

    Attributes
    ----------
    channel : str
        "stress", "mean", "time" or the name of a gauge.
    strain : "exx" or "eyy"
        The strain of a place, along the load.
    instants : int
        In the lines, at most.
    span : (float, float)
        First and last of the channel in them: Pa, 1 or s.
    common : float
        Relative standard uncertainty that all places have in common, beside their sigma.
    vsg_px : float, px
        Side of the virtual strain gauge.
    """

    channel: str
    strain: str
    instants: int
    span: tuple[float, float]
    common: float
    vsg_px: float
    _maps: Mapping[str, Any]

    @property
    def names(self) -> tuple[str, ...]:
        """Of the maps."""
        return tuple(self._maps)

    def map(self, name: str) -> NDArray[Any]:
        """A map, (R, C), in SI units; NaN where a place has no value; ``fate`` counts ``FATES``."""
        return np.asarray(self._maps[name][()])


def read_response(entry: Any, shape: tuple[int, int]) -> StoredResponse | None:
    """The group of an open file; None where there is none, or it was never filled.

    Raises
    ------
    DataError
        It is not as declared.
    """
    if GROUP not in entry:
        return None
    group = open_group(entry, GROUP)
    a = {name: read_attribute(group, name, what) for name, what in ATTRIBUTES.items()}
    channel = printable(as_text(a["channel"]))
    maps = open_datasets(group, declared(channel, shape))
    strain = as_text(a["strain"])
    if not a["instants"]:
        return None
    if strain not in ("exx", "eyy"):
        raise DataError(f"{entry.file.filename}: {GROUP}/@strain is {printable(strain)!r}; make it again")
    span = float(a["first"]), float(a["last"])
    return StoredResponse(
        channel, strain, int(a["instants"]), span, float(a["common"]), float(a["vsg_px"]), maps
    )
