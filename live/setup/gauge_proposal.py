"""A rig file proposed from what was found: devices, specimen, ZOIs, gauges."""

from __future__ import annotations

import datetime
import json
import shlex
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from acquire.errors import ConfigError
from acquire.printable import printable
from live.config.gauges import GaugeTable
from live.config.loading import Config
from live.config.values import AUTO
from live.setup.placement import with_auto_gauges
from live.setup.region import FirstLook, Region, is_auto_region, region_of

SIZES = (64, 48, 32, 24, 16)
ACROSS = 4  # ZOIs side by side on the specimen, at least
STEP_OF_ZOI = 4
SLENDER = 1.5
"""A specimen so many times as long as wide is pulled along its length."""


@dataclass(frozen=True, slots=True, eq=False)
class Proposal:
    """What a rig file is made of.

    Attributes
    ----------
    seen : FirstLook
    region : Region
    config : Config
        With ZOIs, axis and gauges on the specimen as it stands there now.
    camera, load : str
        What these devices are, in words.
    others : tuple of str
        Addresses of other devices that were found.
    """

    seen: FirstLook
    region: Region
    config: Config
    camera: str
    load: str
    others: tuple[str, ...] = ()


def propose(
    seen: FirstLook,
    config: Config,
    said: Iterable[str],
    words: tuple[str, str] = ("", ""),
    others: Iterable[str] = (),
) -> Proposal:
    """Find the specimen in a first look and lay ZOIs and gauges on it.

    Parameters
    ----------
    seen : FirstLook
    config : Config
        What is known; nothing of ``said`` is changed.
    said : iterable of str
        Keys that a person has given, as "measure.zoi".
    words : (str, str)
        What camera and load cell are.
    others : iterable of str

    Raises
    ------
    ConfigError, DataError
        No ZOI fits, or the mask given does not.
    """
    given = set(said)
    whole = is_auto_region(config)
    region = region_of(
        _with(config, zoi=SIZES[-1]) if "measure.zoi" not in given else config, seen.picture, seen.noise
    )
    if "specimen.axis" not in given:
        config = replace(config, specimen=replace(config.specimen, axis=_axis(region, whole)))
    if "measure.zoi" not in given:
        config = _with(config, zoi=_size(region, config, seen))
    if "measure.step" not in given:
        config = _with(config, step=max(1, config.measure.zoi // STEP_OF_ZOI))
    region = region_of(config, seen.picture, seen.noise)
    if "measure.gauges" not in given:
        config = _with(config, gauges=AUTO)
    placed = with_auto_gauges(config, region.grid(config, *seen.size))
    return Proposal(seen, region, placed, *words, tuple(others))


def _with(config: Config, **values: int | str) -> Config:
    return replace(config, measure=replace(config.measure, **values))  # type: ignore[arg-type]


def _axis(region: Region, whole: bool) -> str:
    """Along the longer side of a slender specimen, else y."""
    if not (whole and region.box):
        return "y"
    _, _, width, height = region.box
    return "x" if width > SLENDER * height else "y"


def _size(region: Region, config: Config, seen: FirstLook) -> int:
    """The largest ZOI of which four fit side by side across the middle half of the specimen."""
    width, height = seen.size
    inside = region.inside(width, height, SIZES[-1])
    inside = inside if config.specimen.first_axis == "y" else inside.T
    rows = np.flatnonzero(inside.any(axis=1))
    quarter = len(rows) // 4
    widths = sorted(inside[rows[quarter : len(rows) - quarter]].sum(axis=1))
    narrow = widths[len(widths) // 2] if widths else 0
    for zoi in SIZES:
        try:
            if ACROSS * zoi <= narrow and region.grid(_with(config, zoi=zoi), width, height).n_active:
                return zoi
        except ConfigError:
            continue
    return SIZES[-1]


# -- as TOML ------------------------------------------------------------------------------------


def rig_text(p: Proposal, path: Path, mask: Path | None = None) -> str:
    """The commented TOML of a proposal.

    Parameters
    ----------
    p : Proposal
    path : Path
        Where it will stand, for the commands it names.
    mask : Path, optional
        The mask of the specimen as it stands there now: with it region and gauges are fixed in px; without,
        they are found anew at the start of each test.
    """
    return "\n".join(
        [*_head(path), *_devices(p), *_specimen(p), *_measure(p, mask), *_gauges(p, mask is not None), ""]
    )


def _head(path: Path) -> Iterator[str]:
    name = " ".join(printable(shlex.quote(str(path))).split())
    yield f"# The rig, as phasedic init found it on {datetime.datetime.now(datetime.UTC):%Y-%m-%d %H:%M} UTC."
    yield f"# Next: phasedic check --config {name}, then phasedic run --config {name}"
    yield f"# For lengths in mm: phasedic scale --config {name} --points X1,Y1,X2,Y2 --length MM"


def _devices(p: Proposal) -> Iterator[str]:
    yield from ("", "[camera]")
    yield f"address = {_quoted(p.config.camera.address)}{_remark(p.camera)}"
    yield from ("", "[load]")
    yield f"address = {_quoted(p.config.load.address)}{_remark(p.load)}"
    for other in p.others:
        yield f"# also found: {_quoted(other)}"


def _specimen(p: Proposal) -> Iterator[str]:
    s = p.config.specimen
    yield from ("", "[specimen]")
    yield f"axis = {_quoted(s.axis)}{_remark('direction of the load in the picture')}"
    if s.area_m2 is None:
        yield "# width_mm = 20.0        # the section, for stresses: width and thickness, diameter_mm or area_mm2"
        yield "# thickness_mm = 2.0"


def _measure(p: Proposal, mask: Path | None) -> Iterator[str]:
    m, box = p.config.measure, p.region.box
    yield from ("", "[measure]")
    here = _numbers(box) if box else '"all"'
    if mask is not None:
        yield f"roi = {here}{_remark('x, y, width, height in px')}"
        if p.region.mask is not None:
            yield f"mask = {_quoted(str(mask.resolve()))}"
    elif p.region.found:
        yield f'roi = "auto"{_remark("the specimen, found at the start of each test; given instead:")}'
        yield f"# roi = {here}{_remark('where it is now: x, y, width, height in px')}"
    else:
        yield f"roi = {here}{_remark(p.region.words)}"
    yield f"zoi = {m.zoi}{_remark('side of a ZOI, px: smaller ones resolve more and are noisier (phasedic check)')}"
    yield f"step = {m.step}{_remark('from one ZOI to the next, px')}"
    if mask is None:
        yield f'gauges = "auto"{_remark("axial, transverse and area on the specimen, beside those given below")}'


def _gauges(p: Proposal, fixed: bool) -> Iterator[str]:
    lead = "" if fixed else "# "
    if not fixed:
        yield from (
            "",
            '# As they are now; without the # they stay there (x, y in px, or as "10, 20 mm" with a [scale]).',
        )
    for name, gauge in p.config.gauges.items():
        yield from ("", *(lead + line for line in _gauge(name, gauge)))


def _gauge(name: str, g: GaugeTable) -> Iterator[str]:
    yield f"[gauges.{name}]"
    yield f"kind = {_quoted(g['kind'])}"
    for key in ("start", "end", "box"):
        if key in g:
            yield f"{key} = {_numbers(g[key])}"


def _remark(words: str) -> str:
    return f"   # {printable(' '.join(words.split()))}" if words else ""


def _numbers(values: Iterable[float]) -> str:
    return "[" + ", ".join(f"{value:g}" for value in values) + "]"


def _quoted(text: str) -> str:
    """A text of JSON is one of TOML, but for the half characters that names of files may hold."""
    return json.dumps(text.encode("utf-8", "replace").decode(), ensure_ascii=False)
