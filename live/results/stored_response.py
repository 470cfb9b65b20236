"""The group ``response`` of ``strain.h5``: made with the file where it is asked for, filled when the test is over.

A file that was left before that holds it empty, and is read as one without.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquire import hdf5
from acquire.errors import DataError
from acquire.text.message import printable
from live.pipeline.timed.course import leaves_name, slope_name
from live.results.quantities import quantity_of

GROUP, CURRENT, CORRELATION, FATE = "response", "current", "correlation", "fate"
ATTRIBUTES = {
    "channel": hdf5.Declared("text"), "strain": hdf5.Declared("text"), "instants": hdf5.Declared("int", (), 0),
    "first": hdf5.Declared("f8"), "last": hdf5.Declared("f8"), "common": hdf5.Declared("f8", (), 0),
    "vsg_px": hdf5.Declared("f8", (), 0),
}  # fmt: skip

_NOISE = (CURRENT, CORRELATION)


def map_names(channel: str) -> tuple[str, ...]:
    """All maps over ``channel``."""
    slope, leaves = slope_name(channel), leaves_name(channel)
    first = (slope, f"sigma_{slope}", "chi2", "instants", "poisson", "sigma_poisson")
    return (*first, *((leaves,) if leaves else ()), FATE)


def _items(names: Iterable[str], shape: tuple[int, int]) -> dict[str, hdf5.Declared]:
    """Maps of these names, (R, C), and what the writer notes of noise."""
    shapes = {CURRENT: (None,), CORRELATION: (None, *shape)}
    about = {name: quantity_of(name) for name in names}
    return {
        name: hdf5.Declared(
            "f4", shapes.get(name, shape), unit=one.unit, long_name=one.words, missing=np.nan, rows=0
        )
        for name, one in about.items()
    }


def items(channel: str, shape: tuple[int, int]) -> dict[str, hdf5.Declared]:
    """All datasets of a response over ``channel``."""
    return _items((*map_names(channel), *_NOISE), shape)


def add_group(entry: Any, channel: str, shape: tuple[int, int]) -> None:
    """Make the group, without values, after ``strain``."""
    title = f"Response of each place over {channel}"
    group = hdf5.new_group(
        entry, GROUP, "NXdata", signal=slope_name(channel), title=title, channel=channel, strain="eyy"
    )
    group.attrs.update(axes=["y", "x"], instants=0, first=np.nan, last=np.nan, common=0.0, vsg_px=0.0)
    hdf5.new_datasets(group, items(channel, shape), fixed=False)
    for name in ("x", "y"):
        group[name] = entry[f"strain/{name}"]


def read_noise(path: Path, n: int, shape: tuple[int, int]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """What the writer noted: share of the variance of strains that is not of the reference at each instant, (n,), 1
    where it is not known, and correlation of the noises of exx and eyy against each reference, (J, R, C)."""
    with hdf5.open_file(path) as file:
        group = file["entry"][GROUP]
        noise = hdf5.open_datasets(group, _items(_NOISE, shape))
        held, both = noise[CURRENT][:n].astype(np.float64), noise[CORRELATION][()].astype(np.float64)
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
        with hdf5.open_file(path, "r+", libver=("v110", "v110")) as file:
            group = file["entry"][GROUP]
            for name, values in maps.items():
                group[name][...] = values
            for name, value in about.items():
                kept = group.attrs[name]
                group.attrs.modify(name, np.asarray(value, kept.dtype))
    except (OSError, RuntimeError, KeyError) as error:
        raise DataError("{path}: the response cannot be written ({why})", path, hdf5.reason(error)) from error


@dataclass(frozen=True, slots=True, eq=False)
class StoredResponse:
    """What each place did over all instants.

    Attributes
    ----------
    channel : str
        "stress", "mean", "time" or the name of a gauge.
    instants : int
        In the lines, at most.
    first, last : float
        Of the channel in them: Pa, 1 or s.
    common : float
        Relative standard uncertainty that all places have in common, beside their sigma.
    vsg_px : float, px
        Side of the virtual strain gauge.
    """

    channel: str
    instants: int
    first: float
    last: float
    common: float
    vsg_px: float
    _maps: Mapping[str, Any]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the maps."""
        return tuple(self._maps)

    def map(self, name: str) -> NDArray[Any]:
        """A map, (R, C), in SI units; NaN where a place has no value."""
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
    group = hdf5.open_group(entry, GROUP)
    channel, strain, instants, first, last, common, vsg_px = hdf5.read_attributes(group, ATTRIBUTES).values()
    if hdf5.as_text(strain) not in ("exx", "eyy"):
        raise DataError(
            "{path}: {group}/@strain is {value}; make it again",
            entry.file.filename,
            GROUP,
            repr(printable(hdf5.as_text(strain))),
        )
    channel = printable(hdf5.as_text(channel))
    maps = hdf5.open_datasets(group, _items(map_names(channel), shape))
    if not instants:
        return None
    return StoredResponse(
        channel, int(instants), float(first), float(last), float(common), float(vsg_px), maps
    )
