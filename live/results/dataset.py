"""Results as an ``xarray.Dataset``, where xarray is installed (``phasedic[xarray]``)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from acquire.errors import ConfigError
from analysis.field import ZoiGrid
from live.results.quantities import MEANS, quantity_of

if TYPE_CHECKING:
    from live.results.reader import Strain


class Shown(Protocol):
    """In which units and axes numbers come out."""

    def shown(self, name: str, values: NDArray[Any]) -> NDArray[Any]: ...
    def unit(self, name: str) -> str: ...
    def x(self, grid: ZoiGrid) -> NDArray[np.float64]: ...
    def y(self, grid: ZoiGrid) -> NDArray[np.float64]: ...
    def axes(self) -> str: ...


class Stored:
    """As the file holds them: px, y down, strains dimensionless."""

    def shown(self, name: str, values: NDArray[Any]) -> NDArray[Any]:
        """The same."""
        return values

    def unit(self, name: str) -> str:
        """As it is kept."""
        return quantity_of(name).unit

    def x(self, grid: ZoiGrid) -> NDArray[np.float64]:
        """(C,), px."""
        return grid.x

    def y(self, grid: ZoiGrid) -> NDArray[np.float64]:
        """(R,), px."""
        return grid.y

    def axes(self) -> str:
        """In words."""
        return (
            "x right, y down, px, from the centre of the first pixel; all values lie on the reference picture"
        )


def dataset(strain: Strain, shown: Shown, fields: tuple[str, ...] | None = None) -> Any:
    """Maps and means with coordinates ``time``, ``y``, ``x`` and units; ``fields`` are maps, all without.

    Raises
    ------
    ConfigError
        xarray is not installed.
    DataError
        There is no such map, or it cannot be read.
    """
    try:
        import xarray
    except ImportError:
        raise ConfigError("this needs xarray: pip install 'phasedic[xarray]'") from None
    maps = {
        name: (("time", "y", "x"), shown.shown(name, strain.maps(name)), _attributes(shown, name))
        for name in fields or strain.names
    }
    means = {
        mean_name(name): ("time", shown.shown(name, values), _attributes(shown, name))
        for name, values in strain.values.items()
        if name != "time_s"
    }
    places = {
        "time": ("time", strain.time_s, {"units": "s"}),
        "y": ("y", shown.y(strain.grid), _attributes(shown, "y")),
        "x": ("x", shown.x(strain.grid), _attributes(shown, "x")),
    }
    about = {"strain_measure": strain.strain_measure, "start_time": strain.start_utc, "axes": shown.axes()}
    return xarray.Dataset({**maps, **means}, places, about)


def mean_name(name: str) -> str:
    """The name of a column where it stands beside maps, which may have the same."""
    plain = MEANS.get(name, name)
    if plain.removeprefix("sigma_").startswith("gauge_"):
        return plain
    averaged = quantity_of(plain.removeprefix("sigma_")).is_strain or plain in ("u", "v")
    return f"mean_{plain}" if averaged else plain


def _attributes(shown: Shown, name: str) -> dict[str, str]:
    return {"units": shown.unit(name), "long_name": quantity_of(name).words}
