"""The consumers of a configuration: results, view and status card."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from acquire.clock import ClockPair
from acquire.events import EventKind, Level
from acquire.frame import CameraInfo
from live.channels import Readings
from live.measure import AxisFinder
from live.outputs.consumer import Consumer
from live.outputs.files import Files
from live.outputs.outputs import Outputs
from live.outputs.watching import CardWriter, FiguresWriter, Watching
from live.results import FLUSH_S, Results, ResultsInfo
from live.setup import Config, outlines, versions
from live.tell import Books, Screen, StatusCard
from live.view import View, ViewSetup, spawn_viewer

if TYPE_CHECKING:
    from analysis import ZoiGrid

SELDOM_S = 10.0  # a row may wait for its flush where nobody would have it from a broken run


@dataclass(frozen=True, slots=True, eq=False)
class About:
    """What the outputs must know of a test before it begins.

    Attributes
    ----------
    config : Config
    folder : Path
        Of the files.
    camera : CameraInfo
    grid : ZoiGrid
    start : ClockPair
        Time zero of the files and curves.
    aside : bool
        Nobody looks into ``folder`` before all is done, and it counts for nothing until then.
    """

    config: Config
    folder: Path
    camera: CameraInfo
    grid: ZoiGrid
    start: ClockPair
    aside: bool = False


def make_outputs(about: About, books: Books, screen: Screen, more: Sequence[Consumer] = ()) -> Outputs:
    """Results and, where wanted, the view; ``more`` are consumers of the caller.

    Raises
    ------
    DataError
        A file of the results exists already, or cannot be made.
    """
    config = about.config
    info = ResultsInfo(
        about.start.monotonic,
        about.start.utc.isoformat(),
        config.as_dict(),
        dict(config.metadata),
        versions(),
        about.camera,
        strain_measure=cast(Any, config.measure.strain),
        area_m2=config.specimen.area_m2,
        gauges=dict(config.gauges),
        axis=config.specimen.axis,
        lagged=config.load.lag_s != 0,
    )
    consumers: list[Consumer] = [
        Files(Results(about.folder, about.grid, info, SELDOM_S if about.aside else FLUSH_S))
    ]
    view = _view(about, books, screen)
    if view is not None:
        card = StatusCard(config.specimen, books.loads)
        figures = FiguresWriter(view, _readings(about, books), books)
        consumers += [CardWriter(view, card, books.ledger), figures, Watching(view, books.journal.names)]
    return Outputs([*consumers, *more], books.loads, books.journal, books.history)


def _view(about: About, books: Books, screen: Screen) -> View | None:
    v = about.config.view
    if not (v.enabled or v.rrd):
        return None
    setup = ViewSetup(
        title=about.folder.name,
        width=about.camera.width,
        height=about.camera.height,
        bits=about.camera.bits,
        grid=about.grid,
        start_monotonic=about.start.monotonic,
        area_m2=about.config.specimen.area_m2,
        axis=about.config.specimen.first_axis,
        strain_range=v.strain_range,
        with_load=about.config.load.address != "none:",
        outlines=outlines(about.config.gauges, about.grid.size),
        light=v.light,
        picture_hz=1.0 if v.light else 5.0,
        scale="automatic" if v.scale == "automatic" else "symmetric",
    )
    rrd = about.folder / "view.rrd" if v.rrd else None

    def tell(text: str, level: Level) -> None:
        books.journal.tell(EventKind.VIEW, "view", text, level)

    def serving(view: View) -> None:
        books.vitals.view_port = view.port
        _announce(view, v.spawn, screen)

    port, finder = v.port if v.enabled else None, AxisFinder(about.config.specimen.axis)
    return View(setup, port=port, rrd=rrd, tell=tell, serving=serving, axis=finder)


def _readings(about: About, books: Books) -> Readings:
    """With the newest load while the test runs; in a replay with that of the measurement."""
    specimen, loads, vitals = about.config.specimen, books.loads, books.vitals
    return Readings(
        about.start.monotonic,
        specimen.axis,
        specimen.area_m2,
        lambda: loads.latest if vitals.state else None,
    )


def _announce(view: View, spawn: bool, screen: Screen) -> None:
    """Open the viewer where there is a display; else say how to look."""
    if spawn and view.port is not None and spawn_viewer(view.port) is not None:
        screen.say("the viewer opens in a window of its own")
        return
    screen.say("no viewer is opened here (no display); it runs without, and this shows it:")
    for line in view.address.splitlines():
        screen.say(f"  {line}")
