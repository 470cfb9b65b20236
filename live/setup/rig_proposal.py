"""A proposed rig file: the devices found, and ZOIs and gauges on the specimen found."""

from __future__ import annotations

import datetime
import json
import math
import shlex
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from acquire.errors import ConfigError
from acquire.text.message import printable
from analysis.quality.pattern import zoi_pattern
from analysis.quality.specimen import FoundPlates, find_plates, find_specimen
from live.config.gauges import GaugeTable
from live.config.loading import Config
from live.config.values import AUTO
from live.setup.grid import with_auto_gauges
from live.setup.region import FirstLook, Region, is_auto_region, region_of

ZOI_SIZES = (64, 48, 32, 24, 16)  # px
MIN_ACROSS = 4  # ZOIs side by side on the specimen
STEPS_PER_ZOI = 4
SLENDER = 1.5
"""Length over width above which the load is along the length."""


@dataclass(frozen=True, slots=True, eq=False)
class Proposal:
    """The content of a rig file.

    Attributes
    ----------
    first_look : FirstLook
    region : Region
    config : Config
        With ZOIs, axis and gauges on the specimen in its present place.
    camera, load : str
        Descriptions of these devices.
    others : tuple of str
        Addresses of the other cameras found.
    plates : FoundPlates
        What looks like plates beside the specimen.
    """

    first_look: FirstLook
    region: Region
    config: Config
    camera: str
    load: str
    others: tuple[str, ...] = ()
    plates: FoundPlates = field(default_factory=FoundPlates)

    @property
    def contrast(self) -> float:
        """Median over the ZOIs of the standard deviation of the grey levels without noise, share of full scale."""
        first = self.first_look
        grid = self.region.grid(self.config, *first.size)
        found = zoi_pattern(first.picture.astype(np.float32), grid, first.noise or 0.0)
        variance = float(np.median(found.variance[grid.active]))
        return math.sqrt(variance) / float(2**first.camera.bits - 1)


def propose(
    first: FirstLook,
    config: Config,
    given: Iterable[str],
    descriptions: tuple[str, str] = ("", ""),
    others: Iterable[str] = (),
) -> Proposal:
    """Find the specimen in a first look and place ZOIs and gauges on it.

    Parameters
    ----------
    first : FirstLook
    config : Config
        The known values; those of ``given`` do not change.
    given : iterable of str
        Keys that the user has given, as "measure.zoi".
    descriptions : (str, str)
        Of camera and load cell.
    others : iterable of str

    Raises
    ------
    ConfigError, DataError
        No ZOI fits, or the mask given does not.
    """
    keys, auto_region = set(given), is_auto_region(config)
    region = region_of(
        _with(config, zoi=ZOI_SIZES[-1]) if "measure.zoi" not in keys else config,
        first.picture,
        first.visible_noise,
    )
    if "specimen.axis" not in keys:
        config = replace(config, specimen=replace(config.specimen, axis=_axis(region, auto_region)))
    if "measure.zoi" not in keys:
        config = _with(config, zoi=_size(region, config, first))
    if "measure.step" not in keys:
        config = _with(config, step=max(1, config.measure.zoi // STEPS_PER_ZOI))
    region = region_of(config, first.picture, first.visible_noise)
    if "measure.gauges" not in keys:
        config = _with(config, gauges=AUTO)
    placed = with_auto_gauges(config, region.grid(config, *first.size))
    return Proposal(first, region, placed, *descriptions, tuple(others), _plates(first, auto_region))


def _plates(first: FirstLook, auto_region: bool) -> FoundPlates:
    """What looks like plates beside a specimen that was found."""
    specimen = find_specimen(first.picture, first.visible_noise) if auto_region else None
    return FoundPlates() if specimen is None else find_plates(first.picture, specimen, first.visible_noise)


def _with(config: Config, **values: int | str) -> Config:
    return replace(config, measure=replace(config.measure, **values))  # type: ignore[arg-type]


def _axis(region: Region, auto_region: bool) -> str:
    """The longer side of a slender specimen, else y."""
    if not (auto_region and region.box):
        return "y"
    _, _, width, height = region.box
    return "x" if width > SLENDER * height else "y"


def _size(region: Region, config: Config, first: FirstLook) -> int:
    """The largest ZOI of which four fit side by side across the middle half of the specimen."""
    width, height = first.size
    inside = region.inside(width, height, ZOI_SIZES[-1])
    inside = inside if config.specimen.first_axis == "y" else inside.T
    rows = np.flatnonzero(inside.any(axis=1))
    quarter = len(rows) // 4
    widths = sorted(inside[rows[quarter : len(rows) - quarter]].sum(axis=1))
    middle_width = widths[len(widths) // 2] if widths else 0
    for zoi in ZOI_SIZES:
        try:
            if (
                MIN_ACROSS * zoi <= middle_width
                and region.grid(_with(config, zoi=zoi), width, height).n_active
            ):
                return zoi
        except ConfigError:
            continue
    return ZOI_SIZES[-1]


# -- as TOML ------------------------------------------------------------------------------------


def rig_text(p: Proposal, path: Path, mask: Path | None = None) -> str:
    """The commented TOML of a proposal.

    Parameters
    ----------
    p : Proposal
    path : Path
        Its path, for the commands in its comments.
    mask : Path, optional
        The mask of the specimen in its present place: with it, region and gauges are fixed in px; without,
        they are found at the start of each test.
    """
    placed = (*_gauges(p, mask is not None), *_plate_tables(p))
    return "\n".join([*_head(path), *_devices(p), *_specimen(p), *_measure(p, mask), *placed, ""])


def _head(path: Path) -> Iterator[str]:
    name = " ".join(printable(shlex.quote(str(path))).split())
    yield f"# The rig, found by phasedic init on {datetime.datetime.now(datetime.UTC):%Y-%m-%d %H:%M} UTC."
    yield f"# Next: phasedic check --config {name}, then phasedic run --config {name}"
    yield f"# For lengths in mm: phasedic scale --config {name} --points X1,Y1,X2,Y2 --length MM"


def _devices(p: Proposal) -> Iterator[str]:
    yield from ("", "[camera]")
    yield f"address = {_quoted(p.config.camera.address)}{_comment(p.camera)}"
    yield from ("", "[load]")
    yield f"address = {_quoted(p.config.load.address)}{_comment(p.load)}"
    for other in p.others:
        yield f"# also found: {_quoted(other)}"


def _specimen(p: Proposal) -> Iterator[str]:
    s = p.config.specimen
    yield from ("", "[specimen]")
    yield f"axis = {_quoted(s.axis)}{_comment('direction of the load in the picture')}"
    if s.area_m2 is None:
        yield "# width_mm = 20.0        # for stresses: width and thickness, diameter_mm or area_mm2"
        yield "# thickness_mm = 2.0"


def _measure(p: Proposal, mask: Path | None) -> Iterator[str]:
    m, box = p.config.measure, p.region.box
    yield from ("", "[measure]")
    roi = _numbers(box) if box else '"all"'
    if mask is not None:
        yield f"roi = {roi}{_comment('x, y, width, height in px')}"
        if p.region.mask is not None:
            yield f"mask = {_quoted(str(mask.resolve()))}"
    elif p.region.found:
        yield f'roi = "auto"{_comment("the specimen, found at the start of each test; or fixed:")}'
        yield f"# roi = {roi}{_comment('its present place: x, y, width, height in px')}"
    else:
        yield f"roi = {roi}{_comment(p.region.words)}"
    yield f"zoi = {m.zoi}{_comment('side of a ZOI, px: smaller ones resolve more and are noisier (phasedic check)')}"
    yield f"step = {m.step}{_comment('from one ZOI to the next, px')}"
    if mask is None:
        yield f'gauges = "auto"{_comment("extension, width and area of the specimen, besides those given below")}'


def _gauges(p: Proposal, fixed: bool) -> Iterator[str]:
    lead = "" if fixed else "# "
    if not fixed:
        yield from (
            "",
            '# Their present places; without the # they are fixed (x, y in px, or as "10, 20 mm" with a [scale]).',
        )
    for name, gauge in p.config.gauges.items():
        yield from ("", *(lead + line for line in _gauge(name, gauge)))


def _plate_tables(p: Proposal) -> Iterator[str]:
    """With a # each: a still picture does not show what hangs from a grip and what belongs to the frame."""
    if not p.plates.plates:
        return
    yield from (
        "",
        "# These look like plates. Without the # they remove motion off the plane: only where they hang from one",
    )
    yield "# grip, beside the specimen and not loaded (docs/optics.md)."
    for number, box in enumerate(p.plates.plates, 1):
        yield from (f"# [plate.plate{number}]", f"# box = {_numbers((box.x, box.y, box.width, box.height))}")


def _gauge(name: str, g: GaugeTable) -> Iterator[str]:
    yield f"[gauges.{name}]"
    yield f"kind = {_quoted(g['kind'])}"
    for key in ("start", "end", "box"):
        if key in g:
            yield f"{key} = {_numbers(g[key])}"


def _comment(words: str) -> str:
    return f"   # {printable(' '.join(words.split()))}" if words else ""


def _numbers(values: Iterable[float]) -> str:
    return "[" + ", ".join(f"{value:g}" for value in values) + "]"


def _quoted(text: str) -> str:
    """A TOML string: as in JSON, without the lone surrogates that file names can hold."""
    return json.dumps(text.encode("utf-8", "replace").decode(), ensure_ascii=False)
