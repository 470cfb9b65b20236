"""An export: the run, the maps and instants, the units, and the notes in the files."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

from numpy.typing import NDArray

from acquire.clock import Clock
from acquire.errors import ConfigError
from acquire.text import Message
from analysis.field import Status
from live.pipeline.consumer import Screen
from live.results.place_response import response_lines
from live.results.quantities import Display
from live.results.reader import Strain
from live.results.run_folder import RunFolder
from live.results.stored_response import GROUP

USUAL = ("u", "v", "exx", "eyy", "exy", "sigma_exx", "sigma_eyy", "sigma_exy", "status")
QUIET_S = 2.0  # a shorter export shows no progress

_MEASURES = {
    "engineering": "engineering strain: elongation over length of lines along x and y; exy half the shear angle",
    "small": "small strain: exx = du/dx, eyy = dv/dy, exy = (du/dy + dv/dx)/2",
    "green": "Green-Lagrange strain: E = (F'F - 1)/2",
    "hencky": "Hencky (logarithmic) strain: ln(F'F)/2",
}


@dataclass(frozen=True, slots=True)
class ExportOptions:
    """Options of some formats.

    Attributes
    ----------
    layout : "long" | "wide" | "means"
        Of tables.
    fps : float, 1/s
        Of films.
    limit : float or None
        The colour range is -limit to limit, in the unit of the map as it is stored; automatic without.
    picture : bool
        Maps are painted over the pictures.
    """

    layout: str = "long"
    fps: float = 10.0
    limit: float | None = None
    picture: bool = True


@dataclass(frozen=True, slots=True, eq=False)
class ExportJob:
    """An export.

    Attributes
    ----------
    run : RunFolder
    fields : tuple of str
        Maps of ``strain.h5``.
    rows : tuple of int
        Instants, ascending.
    display : Display
    screen : Screen
        Shows the progress.
    options : ExportOptions
    """

    run: RunFolder
    fields: tuple[str, ...]
    rows: tuple[int, ...]
    display: Display
    screen: Screen
    options: ExportOptions = field(default_factory=ExportOptions)

    @property
    def strain(self) -> Strain:
        """The results."""
        return self.run.strain

    def map(self, name: str, row: int) -> NDArray[Any]:
        """One map in the units of the export, (R, C)."""
        return self.display.shown(name, self.strain.maps(name, row))

    def column(self, name: str) -> NDArray[Any]:
        """A column of ``Strain.values`` in the units of the export, (number of rows,)."""
        values = self.display.shown(name, self.strain.values[name][list(self.rows)])
        return -values if self.display.y_up and self._is_shear(name) else values

    def _is_shear(self, name: str) -> bool:
        """Whether a column is of a gauge that reads a shear, which changes its sign with the y axis."""
        gauge = self.run.gauges.get(name.removeprefix("gauge_"))
        return gauge is not None and gauge.described.get("value") in ("exy", "gamma_xy")

    def steps(self, now: Clock = time.monotonic) -> Iterator[tuple[int, int]]:
        """(k, row) for each instant; shows the progress after two seconds."""
        began = now()
        for k, row in enumerate(self.rows):
            spent = now() - began
            if spent > QUIET_S and k:
                left = spent / k * (len(self.rows) - k)
                self.screen.status(
                    Message("instant {k} of {n}, about {left:.0f} s left", k, len(self.rows), left)
                )
            yield k, row

    def notes(self) -> list[str]:
        """Notes for the reader of the file: origin, conventions, statuses."""
        strain = self.strain
        version = strain.versions.get("phasedic", "")
        lines = [
            f"{self.run.title}: exported by phasedic from {strain.path.name}, measured by phasedic {version}",
            f"test started {strain.start_utc}; ZOIs of {strain.grid.size} px, {strain.grid.step} px apart",
            _MEASURES.get(strain.strain_measure, strain.strain_measure),
            self.display.axes(),
        ]
        if "status" in self.fields and self.options.layout != "means":
            lines.append("status: " + ", ".join(f"{int(s)} {s.name}" for s in Status))
        return lines + (response_lines(strain) if {*self.fields} & {*strain.whole_names} else [])


def chosen_fields(strain: Strain, requested: str | None, usual: Sequence[str] = USUAL) -> tuple[str, ...]:
    """Names of maps: ``usual`` for None, all for "all", those of the whole test for "response", else those named.

    Raises
    ------
    ConfigError
        There is no such map.
    """
    if requested is None:
        return tuple(name for name in usual if name in strain.names)
    if requested == "all":
        return strain.names
    if requested == GROUP and strain.whole_names:
        return strain.whole_names
    names = tuple(dict.fromkeys(word.strip() for word in requested.split(",")))
    known = (*strain.names, *strain.whole_names)
    for name in names:
        if name not in known:
            raise ConfigError(
                "--fields {name}: there is no such map; there are {known}", name, ", ".join(known)
            )
    return names
