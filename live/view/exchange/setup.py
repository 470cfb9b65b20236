"""What the view needs to know before the first picture."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from analysis.field import ZoiGrid

STRAINS = ("exx", "eyy", "exy")
MAPS = (*STRAINS, "e1", "e2", "sigma", "residual", "status")
"""What is shown as maps: strains, principal strains, sigma of the strain along the load, chi squared, status."""


@dataclass(frozen=True, slots=True, eq=False)
class ViewSetup:
    """What is shown, and how.

    Attributes
    ----------
    title : str
        Name of the test, shown by the viewer.
    width, height : int, px
        Of the camera's picture.
    bits : int
        Significant bits of a sample of it.
    grid : ZoiGrid
    start_monotonic : float, s
        Zero of the timeline "time".
    area_m2 : float or None, m^2
        Cross-section; with it the curve is stress against strain, else load against strain.
    axis : "x" | "y"
        Direction of the load in the picture.
    strain_range : float or None
        Fixed symmetric range of the maps (dimensionless); None: automatic.
    picture_hz : float, 1/s
        Pictures shown per second of the test, at most.
    finished : bool
        A test of the past: all that is told is shown, kept for the slider of time, and every ZOI tells its values.
    with_load : bool
        Whether there is a load to show.
    outlines : mapping of name to (((x, y), ...), ...), px
        Lines drawn on the picture: gauges.
    gauges : sequence of str
        Those whose strain is drawn over time.
    light : bool
        For slow links: pictures and maps smaller and seldom.
    scale : "symmetric" | "automatic"
        Colours of the maps about zero, or over the values there are.
    """

    title: str
    width: int
    height: int
    bits: int
    grid: ZoiGrid
    start_monotonic: float
    area_m2: float | None = None
    axis: Literal["x", "y"] = "y"
    strain_range: float | None = None
    picture_hz: float = 5.0
    finished: bool = False
    with_load: bool = True
    outlines: Mapping[str, tuple[tuple[tuple[float, float], ...], ...]] = field(default_factory=dict)
    gauges: Sequence[str] = ()
    light: bool = False
    scale: Literal["symmetric", "automatic"] = "symmetric"
