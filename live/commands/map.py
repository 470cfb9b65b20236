"""``phasedic map``: a map of the results over the reference picture, as a file.

Values are drawn as measured, one square a ZOI. Filters and deconvolution are options for the picture only, and
the title names them. A rejected ZOI is transparent; the field "status" shows why.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquire.cv2_loader import encoded
from acquire.errors import ConfigError
from acquire.opencv.images import read_image
from acquire.text import Message
from acquire.text.message import printable
from analysis.evaluate import deconvolved, effect
from analysis.field import ZoiGrid
from live.commands.options import number, whole
from live.config.new_files import new_file
from live.results.maps.painting import Image, Painter
from live.results.maps.scale import AutoRange, ColourScale, range_kind
from live.results.place_response import response_title
from live.results.reader import Strain
from live.results.run_folder import open_run
from live.ui.terminal.screen import print_line

DISPLACEMENTS = ("u", "v")
MAX_MEDIAN, MAX_STEPS, MAX_SHARPENED = 51, 100, 4
FORMATS = (".png", ".jpg")
PAPER_LOW_PASS = 9.0  # px; the paper filters its maps "for cosmetic reasons": median, then Gaussian

_VISIBLE_PX = 2.0


@dataclass(frozen=True, slots=True)
class MapRequest:
    """The map to draw.

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
        Steps that remove the window's blur (``analysis.evaluate.deconvolution``); 0 for none.
    sharpened : int
        How often the response of the deconvolution is sharpened.
    """

    field: str
    row: int = -1
    limit: float | None = None
    title: str = ""
    median: int = 1
    low_pass_px: float = 0.0
    deconvolution: int = 0
    sharpened: int = 0

    def check(self, grid: ZoiGrid) -> None:
        """Raise ConfigError where a number is impossible, or out of range for ``grid``."""
        extent = max(grid.shape) * grid.step
        whole = Message("0 to {extent} px, the extent of the grid", extent)
        steps, times = Message("0 to {most} steps", MAX_STEPS), Message("0 to {most} times", MAX_SHARPENED)
        limit, low_pass, odd = self.limit, self.low_pass_px, self.median in range(1, MAX_MEDIAN + 1, 2)
        for what, value, well, allowed in (
            ("limit", limit, limit is None or 0 < limit < math.inf, Message("a number above 0")),
            ("median", self.median, odd, Message("an odd number from 1 to {most}", MAX_MEDIAN)),
            ("low-pass", low_pass, 0 <= low_pass <= extent, whole),
            ("deconvolution", self.deconvolution, 0 <= self.deconvolution <= MAX_STEPS, steps),
            ("sharpening", self.sharpened, 0 <= self.sharpened <= MAX_SHARPENED, times),
        ):  # fmt: skip
            if not well:
                raise ConfigError(
                    "a {what} of {value} is not possible; allowed: {allowed}", what, value, allowed
                )
        if self.sharpened and not self.deconvolution:
            raise ConfigError("only a deconvolved map can be sharpened; add --deconvolve STEPS")

    def treatment(self, grid: ZoiGrid) -> str:
        """The filters applied to the map, as text; "" for none."""
        words = []
        if self.deconvolution:
            done = effect(grid, self.deconvolution, self.sharpened)
            noise = done.noise if self.field in DISPLACEMENTS else done.noise_gradient
            how = f"{self.deconvolution} steps" + f", sharpened {self.sharpened} x" * (self.sharpened > 0)
            words = [f"deconvolved, {how}: l_10% {done.l10:.0f} px, noise x {noise:.2f}"]
        words += [f"median {self.median} x {self.median}"] * (self.median > 1)
        words += [f"low-pass {self.low_pass_px:g} px"] * (self.low_pass_px > 0)
        return ", ".join(words)


def draw(strain: Strain, request: MapRequest, background: NDArray[Any] | None) -> Image:
    """The map over ``background`` (H, W) with title, axes and colour bar, (h, w, 3) uint8: blue, green, red.

    Raises
    ------
    DataError
        There is no such map or row.
    ConfigError
        ``request`` is impossible.
    """
    request.check(strain.grid)
    name, row, grid = request.field, request.row, strain.grid
    values = _treated(strain, request)
    scale = None
    if name != "status":
        span = AutoRange(range_kind(name), request.limit).update(values, _sigma(strain, name, row))
        scale = ColourScale.of(name, span)
    size = (2 * grid.roi.x + grid.roi.width, 2 * grid.roi.y + grid.roi.height)
    if background is not None:
        size = background.shape[1], background.shape[0]
    painter = Painter(strain, name, scale, size)
    painted = painter.over(painter.picture(background), row, values, moved=False)
    treatment = request.treatment(grid)
    about = response_title(strain, name) or f"{name}, {strain.time_s[row]:.2f} s, ZOI {grid.size} px"
    title = request.title or about
    return painter.framed(painted, [title, treatment] if treatment else [title], row, axes=True)


def for_display(
    values: NDArray[np.float64], step: int, low_pass_px: float = PAPER_LOW_PASS, median: int = 3
) -> NDArray[np.float64]:
    """A map as the paper shows it: salt-and-pepper (median) filter, then a Gaussian low-pass.

    Parameters
    ----------
    values : (R, C), NaN where not measured; stays NaN there
    step : int, px
        Between the points of the map.
    low_pass_px : float, px
        sigma; 0: none.
    median : int
        Side of the median filter, points; 1: none.
    """
    from scipy.ndimage import gaussian_filter, generic_filter

    valid = np.isfinite(values)
    out = values.copy()
    if median > 1:
        out = np.where(
            valid, generic_filter(np.where(valid, values, np.nan), _nanmedian, median, mode="nearest"), np.nan
        )
    if low_pass_px > 0:
        weight = gaussian_filter(valid.astype(float), low_pass_px / step, mode="nearest")
        total = gaussian_filter(np.where(valid, out, 0.0), low_pass_px / step, mode="nearest")
        out = np.where(valid, total / np.maximum(weight, 1e-9), np.nan)
    return np.asarray(out)


def _nanmedian(values: NDArray[np.float64]) -> float:
    good = values[np.isfinite(values)]
    return float(np.median(good)) if good.size else float("nan")


def save(image: Image, path: Path) -> None:
    """Write the picture to a new file, in the format that its name ends in.

    Raises
    ------
    ConfigError
        The file exists, or has another ending than ``FORMATS``.
    DataError
        It cannot be written.
    """
    if path.suffix.lower() not in FORMATS:
        raise ConfigError("{path}: choose a name that ends in {endings}", path, ", ".join(FORMATS))
    with new_file(path) as part:
        part.write_bytes(encoded(path.suffix.lower(), image))


def _sigma(strain: Strain, name: str, row: int) -> NDArray[Any] | None:
    return (
        strain.maps(f"sigma_{name}", row) if f"sigma_{name}" in (*strain.names, *strain.whole_names) else None
    )


def _treated(strain: Strain, request: MapRequest) -> NDArray[np.float64]:
    """The map to draw; stored values stay as they are."""
    values = np.array(strain.maps(request.field, request.row), np.float64)
    treated = request.deconvolution or request.median > 1 or request.low_pass_px > 0
    if request.field == "status" and treated:
        raise ConfigError("a map of statuses is neither filtered nor deconvolved")
    if request.deconvolution:
        _check_blur(strain.config.get("measure", {}), request.field)
        try:
            values = deconvolved(values, strain.grid, request.deconvolution, request.sharpened)
        except ValueError as error:
            raise ConfigError(str(error)) from None
    return for_display(values, strain.grid.step, request.low_pass_px, request.median)


def _check_blur(measure: Mapping[str, Any], field: str) -> None:
    """Raise ConfigError where the blur of the map is not known."""
    if field.startswith(("sigma", "residual")):
        raise ConfigError("{field} has no blur to remove; deconvolve a displacement or a strain", field)
    for key, value in (("order", 1), ("window", "gaussian"), ("estimator", "spectral")):
        if measure.get(key, value) != value:
            raise ConfigError(
                "only maps measured with {key} = {value} can be deconvolved, not with {other}",
                key,
                value,
                measure[key],
            )


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``phasedic map``."""
    parser.add_argument("results", help="folder of a run or replay, or a strain.h5")
    parser.add_argument("png", help="picture to write, .png or .jpg")
    parser.add_argument(
        "--field",
        default="eyy",
        help="u, v, exx, eyy, exy, sigma_eyy, residual, status, a map of replay --response ... (default eyy)",
    )
    parser.add_argument(
        "--row", type=whole(), default=-1, help="number of the instant, from 0 (default: the last)"
    )
    parser.add_argument("--over", metavar="FILE", help="picture under the map")
    parser.add_argument("--limit", type=number(), help="colour range -LIMIT to LIMIT (default: automatic)")
    parser.add_argument("--title", help="title (default: map, time and ZOI)")
    words = "median filter of N x N ZOIs, for display only"
    parser.add_argument("--median", type=whole(), default=1, metavar="N", help=words)
    words = "standard deviation of a Gaussian filter, for display only"
    parser.add_argument("--low-pass", type=number(), default=0.0, metavar="PX", help=words)
    words = "reduce the blur by the ZOI, for display only (order 1): 3 or 7 steps, noted in the title"
    parser.add_argument("--deconvolve", type=whole(), default=0, metavar="STEPS", help=words)
    words = "with --deconvolve: make its response end N times more abruptly: less noise, longer ringing beside an edge"
    parser.add_argument("--sharpen", type=whole(), default=0, metavar="N", help=words)


def command(arguments: argparse.Namespace) -> int:
    """``phasedic map``."""
    background = None if arguments.over is None else read_image(Path(arguments.over), gray="luma")
    path = Path(arguments.png)
    with open_run(arguments.results) as run:
        strain = run.strain
        picture = MapRequest(
            arguments.field,
            arguments.row,
            arguments.limit,
            printable(arguments.title or ""),
            arguments.median,
            arguments.low_pass,
            arguments.deconvolve,
            arguments.sharpen,
        )
        save(draw(strain, picture, background), path)
        if arguments.over is not None:
            _warn_of_motion(strain, arguments.row)
    print_line(str(path))
    return 0


def _warn_of_motion(strain: Strain, row: int) -> None:
    """Warn if the specimen moved: the map lies on the reference, and on a later picture it is misplaced."""
    moved = float(np.nanmax(np.hypot(strain.maps("u", row), strain.maps("v", row)), initial=0.0))
    if moved > _VISIBLE_PX:
        print_line(
            Message(
                "note: the ZOIs lie where they were in the reference; the specimen moved by up to {moved:.0f} px since:"
                " phasedic export --to png moves the map with it",
                moved,
            )
        )
