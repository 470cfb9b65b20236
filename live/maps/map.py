"""A map of the results over a picture, as a figure to put into a report.

Values are drawn as they were measured, one square a ZOI; filters and deconvolution are options, and
the title names them. A ZOI that was rejected stays transparent, and the field "status" shows why.
Needs matplotlib (``pip install phasedic[plots]``).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquire.errors import ConfigError, DataError
from analysis.evaluate import deconvolved, effect
from analysis.field import Status, ZoiGrid
from live.maps.colours import diverging_table, unit_for
from live.maps.display_filter import for_display
from live.results import Strain

DISPLACEMENTS = ("u", "v")
MOST_MEDIAN, MOST_STEPS = 51, 100
FORMATS = (".png", ".svg", ".pdf")
STATUS_COLOURS = (
    "#2a9d4b", "#00000000", "#7f7f7f", "#f2c80f", "#9467bd", "#d62728", "#ff7f0e", "#1f77b4",
    "#8c564b", "#e377c2", "#17becf", "#bcbd22",
)  # fmt: skip
"""Of the members of ``Status``, in their order; what was not asked for is transparent."""


@dataclass(frozen=True, slots=True)
class Picture:
    """What to draw.

    Attributes
    ----------
    field : str
        A map of ``strain.h5``: u, v, exx, eyy, exy, a gradient, a sigma, residual or status.
    row : int
        Which instant; -1 is the last.
    limit : float or None
        The colour range is -limit to limit (px for displacements, else dimensionless); automatic without.
    title : str
    median : int
        Side of a median filter, ZOIs; 1 for none.
    low_pass_px : float, px
        Sigma of a Gaussian filter; 0 for none.
    deconvolution : int
        Steps that take off the window's blur (``analysis.evaluate.deconvolution``); 0 for none.
    """

    field: str
    row: int = -1
    limit: float | None = None
    title: str = ""
    median: int = 1
    low_pass_px: float = 0.0
    deconvolution: int = 0

    def check(self, grid: ZoiGrid) -> None:
        """Raises ConfigError where a number is impossible, or beyond what makes sense on ``grid``."""
        extent = max(grid.shape) * grid.step
        limit, low_pass, odd = self.limit, self.low_pass_px, self.median in range(1, MOST_MEDIAN + 1, 2)
        for what, value, well, allowed in (
            ("limit", limit, limit is None or 0 < limit < math.inf, "a number above 0"),
            ("median", self.median, odd, f"an odd number from 1 to {MOST_MEDIAN}"),
            ("low-pass", low_pass, 0 <= low_pass <= extent, f"0 to {extent} px, the extent of the grid"),
            ("deconvolution", self.deconvolution, 0 <= self.deconvolution <= MOST_STEPS, f"0 to {MOST_STEPS} steps"),
        ):  # fmt: skip
            if not well:
                raise ConfigError(f"a {what} of {value} is not possible; allowed: {allowed}")

    def treatment(self, grid: ZoiGrid) -> str:
        """What was done to the map before it was drawn, in words; "" for nothing."""
        words = []
        if self.deconvolution:
            done = effect(grid, self.deconvolution)
            noise = done.noise if self.field in DISPLACEMENTS else done.noise_gradient
            words = [f"deconvolved, {self.deconvolution} steps: l_10% {done.l10:.0f} px, noise x {noise:.2f}"]
        words += [f"median {self.median} x {self.median}"] * (self.median > 1)
        words += [f"low-pass {self.low_pass_px:g} px"] * (self.low_pass_px > 0)
        return ", ".join(words)


def pyplot() -> Any:
    """matplotlib without a screen; raises ConfigError where it is not installed."""
    try:
        import matplotlib as mpl

        mpl.use("Agg")
        import matplotlib.pyplot as plt
    except ImportError:
        raise ConfigError("drawing needs matplotlib: pip install 'phasedic[plots]'") from None
    return plt


def draw(strain: Strain, picture: Picture, background: NDArray[Any] | None) -> Any:
    """The map over ``background`` (H, W), with a colour bar; a matplotlib figure.

    Raises
    ------
    DataError
        There is no such map or row.
    ConfigError
        matplotlib is not installed, or ``picture`` asks for what is impossible.
    """
    plt = pyplot()
    picture.check(strain.grid)
    values = _treated(strain, picture)
    x, y, step = strain.grid.x, strain.grid.y, strain.grid.step
    extent = (x[0] - step / 2, x[-1] + step / 2, y[-1] + step / 2, y[0] - step / 2)
    shape = background.shape if background is not None else (int(extent[2]) + 1, int(extent[1]) + 1)
    height = 7.0
    wide = min(max(shape[1] / shape[0], 0.1), 10)
    figure, axes = plt.subplots(figsize=(height * wide + 1.9, height), layout="constrained")
    if background is not None:
        axes.imshow(background, cmap="gray", alpha=0.9)
    axes.set(xlim=(-0.5, shape[1] - 0.5), ylim=(shape[0] - 0.5, -0.5), xlabel="x, px", ylabel="y, px")
    if picture.field == "status":
        _draw_status(figure, axes, values, extent)
    else:
        _draw_values(figure, axes, values, extent, picture)
    time = strain.time_s[picture.row]
    title = picture.title or f"{picture.field}, {time:.2f} s, ZOI {strain.grid.size} px"
    treatment = picture.treatment(strain.grid)
    axes.set_title(f"{title}\n({treatment})" if treatment else title, fontsize=10, parse_math=False)
    return figure


def save(figure: Any, path: Path) -> None:
    """Write the figure to a new file, in the format that its name ends in.

    Raises
    ------
    ConfigError
        The file exists, or has another ending than ``FORMATS``.
    DataError
        It cannot be written.
    """
    if path.suffix.lower() not in FORMATS:
        raise ConfigError(f"{path}: choose a name that ends in {', '.join(FORMATS)}")
    try:
        with path.open("xb") as file:
            figure.savefig(file, dpi=110, format=path.suffix.lower().lstrip("."))
    except FileExistsError:
        raise ConfigError(f"{path} exists and is not overwritten; choose another name") from None
    except OSError as error:
        raise DataError(
            f"{path}: cannot be written: {error.strerror}; look at the folder and the disk"
        ) from None


def _treated(strain: Strain, picture: Picture) -> NDArray[np.float64]:
    """The map as it is to be drawn; stored values stay as they are."""
    values = np.array(strain.maps(picture.field, picture.row), np.float64)
    treated = picture.deconvolution or picture.median > 1 or picture.low_pass_px > 0
    if picture.field == "status" and treated:
        raise ConfigError("a map of statuses is neither filtered nor deconvolved")
    if picture.deconvolution:
        _check_blur(strain.config.get("measure", {}), picture.field)
        try:
            values = deconvolved(values, strain.grid, picture.deconvolution)
        except ValueError as error:
            raise ConfigError(str(error)) from None
    return for_display(values, strain.grid.step, picture.low_pass_px, picture.median)


def _check_blur(measure: Mapping[str, Any], field: str) -> None:
    """Raises ConfigError unless the map is one whose blur is known."""
    if field.startswith(("sigma", "residual")):
        raise ConfigError(f"{field} has no blur to take off; deconvolve a displacement or a strain")
    for key, value in (("order", 1), ("window", "gaussian"), ("estimator", "spectral")):
        if measure.get(key, value) != value:
            raise ConfigError(
                f"only maps measured with {key} = {value} can be deconvolved, not with {measure[key]}"
            )


def _draw_values(figure: Any, axes: Any, values: NDArray[Any], extent: Any, picture: Picture) -> None:
    from matplotlib.colors import ListedColormap

    valid = values[np.isfinite(values)]
    limit = picture.limit or (float(np.percentile(np.abs(valid), 98)) if valid.size else 1.0)
    factor, label = 1.0, f"{picture.field}, px"
    symmetric = not picture.field.startswith(("sigma", "residual"))
    if picture.field not in DISPLACEMENTS and picture.field != "residual":
        unit = unit_for(limit)
        factor, label = unit.factor, f"{picture.field}, {unit.name}"
    low = -limit if symmetric else 0.0
    if picture.field in DISPLACEMENTS and valid.size and picture.limit is None:
        low, limit = float(np.percentile(valid, 1)), float(np.percentile(valid, 99))
    shown = axes.imshow(
        values * factor,
        extent=extent,
        cmap=ListedColormap(diverging_table() / 255.0) if symmetric else "viridis",
        vmin=low * factor,
        vmax=limit * factor,
        interpolation="nearest",
        alpha=0.8,
    )
    figure.colorbar(shown, ax=axes, label=label, shrink=0.8, extend="both")


def _draw_status(figure: Any, axes: Any, values: NDArray[Any], extent: Any) -> None:
    from matplotlib.colors import BoundaryNorm, ListedColormap
    from matplotlib.patches import Patch

    states = list(Status)
    colours = [STATUS_COLOURS[i % len(STATUS_COLOURS)] for i in range(len(states))]
    bounds = np.arange(len(states) + 1) - 0.5
    place = {int(state): i for i, state in enumerate(states)}
    indices = np.vectorize(lambda value: place.get(int(value), 0))(values)
    axes.imshow(
        indices,
        extent=extent,
        cmap=ListedColormap(colours),
        norm=BoundaryNorm(bounds, len(states)),
        interpolation="nearest",
        alpha=0.75,
    )
    counts = [int((indices == i).sum()) for i in range(len(states))]
    handles = [
        Patch(color=colours[i], label=f"{state.name} ({counts[i]})")
        for i, state in enumerate(states)
        if counts[i] and state is not Status.NOT_MEASURED
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=2, fontsize=8)
