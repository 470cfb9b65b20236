"""``phasedic init``: write a rig file from the devices found and a first picture, without questions."""

from __future__ import annotations

import argparse
import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from acquire.addresses import parse_address
from acquire.errors import LOSS, DeviceError
from acquire.files.picture import write_picture
from acquire.text import Amount, Message, about, joined, word
from acquire.text.message import printable
from live.commands import options
from live.config.loading import load_config
from live.config.rig_file import new_rig
from live.pipeline.consumer import Screen
from live.setup.pictures import mask_picture
from live.setup.region import first_look
from live.setup.rig_proposal import Proposal, propose, rig_text
from live.setup.specimen_drawing import Overlay, snapshot
from live.ui.terminal.screen import TerminalScreen

NO_PATTERN = 0.01  # of full scale; a pattern of less is lost in the noise
RECORDED = ("files", "video", "session")
MEASURE = (
    "roi", "mask", "zoi", "step", "gauges", "burst", "reference-burst", "noise", "scale", "axis",
)  # fmt: skip
PROPOSED = ("measure.roi", "measure.mask", "measure.zoi", "measure.step", "measure.gauges", "camera.address",
       "load.address", "specimen.axis")  # fmt: skip
"""Keys in the text of a proposal; other given keys are added to it."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``phasedic init``."""
    parser.add_argument(
        "file", nargs="?", default="rig.toml", help="new rig file (default: rig.toml); never overwritten"
    )
    parser.add_argument(
        "--fixed", action="store_true", help="fix region, mask and gauges in their present places, in px"
    )
    parser.add_argument(
        "--snapshot", metavar="FILE", help="new picture of the set-up (default: beside the rig file)"
    )
    options.add_options(parser, "devices (default: those found)", "camera", "crop", "load", "dark", "flat")
    options.add_options(parser, "measurement", *MEASURE)
    options.add_section(parser)
    options.add_verbose(parser)
    options.add_help_all(parser)


def command(arguments: argparse.Namespace) -> int:
    """``phasedic init``; 5, and no file, where no pattern is visible."""
    screen = TerminalScreen()
    rig = Path(arguments.file)
    png = Path(arguments.snapshot) if arguments.snapshot else rig.with_suffix(".png")
    mask = rig.with_name(f"{rig.stem}-mask.png") if arguments.fixed else None
    options.require_new(rig)
    options.require_new(png, *options.PICTURES)
    if mask is not None:
        options.require_new(mask)
    given = options.overrides(arguments)
    found = find_devices(given, screen)
    config = load_config(None, {**given, "camera.address": found.camera, "load.address": found.load})
    first = first_look(config, screen)
    descriptions = found.camera_words or printable(first.camera.name), found.load_words
    proposal = propose(first, config, given, descriptions, found.others)
    if proposal.contrast < NO_PATTERN:
        screen.print(
            Message(
                "no pattern is visible (contrast {share:.1%} of full scale), nothing is written: set light and focus",
                proposal.contrast,
            )
        )
        return LOSS
    if mask is not None and proposal.region.mask is not None:
        write_picture(mask, mask_picture(proposal.region.mask))
    changes = {
        key: value
        for key, value in given.items()
        if key not in PROPOSED or key in _kept(given, arguments.fixed)
    }
    new_rig(rig, rig_text(proposal, rig, mask), changes)
    _draw(proposal, png)
    _print(proposal, rig, png, screen)
    return 0


def _kept(given: dict[str, object], fixed: bool) -> set[str]:
    """Keys that the file has as given, not as found."""
    return set() if fixed else {"measure.roi", "measure.mask", "measure.gauges"} & set(given)


# -- devices ------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class FoundDevices:
    """Camera and load cell of the rig, and the other cameras."""

    camera: str
    camera_words: str
    load: str
    load_words: str
    others: tuple[str, ...] = ()


def find_devices(given: dict[str, object], screen: Screen) -> FoundDevices:
    """Camera and load cell as ``given``, else those found; raises DeviceError without a camera."""
    camera, descriptions, others = str(given.get("camera.address") or ""), "", tuple[str, ...]()
    if not camera:
        camera, descriptions, others = _camera()
        screen.print(Message("camera: {camera}  {words}", camera, descriptions))
    load, load_words = str(given.get("load.address") or ""), ""
    if not load:
        load, load_words = _load(camera, screen)
        screen.print(Message("load cell: {address}  {words}", load, load_words))
    return FoundDevices(camera, printable(descriptions), load, printable(load_words), others)


def _camera() -> tuple[str, str, tuple[str, ...]]:
    """The first usable camera, its name, and the others."""
    from acquire.camera import list_cameras

    cameras = list_cameras()
    usable = [camera for camera in cameras if not camera.trouble]
    if not usable:
        why = joined("; ", (about(one.address, one.trouble) for one in cameras)) or word("none is plugged in")
        raise DeviceError(
            "no camera can be used ({why}); plug one in, or give --camera ADDRESS (files:shots, sim:)", why
        )
    first, *others = usable
    return _stable(first.address, first.stable_address), first.name, tuple(c.address for c in others)


def _stable(address: str, stable: str) -> str:
    """The address that stays the same when the camera is plugged in again, with its settings."""
    _, mark, settings = address.partition("?")
    return f"{stable}{mark}{settings}" if stable and "?" not in stable else stable or address


def _load(camera: str, screen: Screen) -> tuple[str, str]:
    """The load cell for a camera: simulated with a simulated one, none with pictures, else one found."""
    from acquire.camera import with_scheme

    scheme = parse_address(with_scheme(camera)).scheme
    if scheme in ("sim", *RECORDED):
        return ("sim:", word("simulated")) if scheme == "sim" else ("none:", word("pictures have none"))
    return next(_listen(screen), ("none:", word("none found; see phasedic identify, give it with --load")))


def _listen(screen: Screen) -> Iterator[tuple[str, str]]:
    """The load cells on the serial ports that send without a query."""
    from acquire.serial_line import identify
    from acquire.serial_line.ports import list_serial_ports

    for port in list_serial_ports():
        if not port.accessible:
            screen.print(port.text().strip())
            continue
        screen.print(Message("listening on {port} (--load ADDRESS or --load none: skips this)", port.device))
        for _, _, finding in identify.listen(port.device):
            if finding is not None:
                yield finding.address, finding.remark or finding.protocol


# -- output -------------------------------------------------------------------------------------


def _draw(p: Proposal, png: Path) -> None:
    grid = p.region.grid(p.config, *p.first_look.size)
    overlay = Overlay(p.region, grid, p.config.gauges, px_per_mm=p.config.scale.px_per_mm)
    write_picture(png, snapshot(p.first_look.picture, overlay))


def _print(p: Proposal, rig: Path, png: Path, screen: Screen) -> None:
    grid = p.region.grid(p.config, *p.first_look.size)
    screen.print(p.region.words)
    n = Amount("count", grid.n_active)
    zois = Message("{n} ZOIs of {size} px, {step} px apart", n, grid.size, grid.step)
    screen.print(zois + Message("; load along {axis}", p.config.specimen.axis))
    screen.print(Message("gauges: {names}", ", ".join(p.config.gauges) or Message("none")))
    for box in p.plates.plates:
        what = Message("in {rig} behind a #: it must hang from one grip, unloaded", rig)
        screen.print(Message("looks like a plate: {box}; {what}", box.text, what))
    for box in p.plates.unclear:
        screen.print(Message("a pattern beside the specimen that is not clearly a plate: {box}", box.text))
    screen.print(Message("written: {rig}, and {png} as a picture of it", rig, png))
    name = shlex.quote(str(rig))
    screen.print(Message("next: phasedic check --config {name}, then phasedic run --config {name}", name))
