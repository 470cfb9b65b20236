"""The consumers of a configuration: results, view and status card."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from acquire.clock import ClockPair
from acquire.events import EventKind, Level
from acquire.frame import CameraInfo
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
        consumers += [CardWriter(view, card, books), FiguresWriter(view, books), Watching(view, books)]
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
        _announce(view, v.spawn, screen, lambda text: tell(text, "warning"))

    port = v.port if v.enabled else None
    return View(setup, port=port, rrd=rrd, tell=tell, serving=serving)


def _announce(view: View, spawn: bool, screen: Screen, trouble: Callable[[str], None]) -> None:
    """Open the viewer where there is a display; else say how to look."""
    if spawn and view.port is not None and spawn_viewer(view.port, trouble) is not None:
        screen.say("the viewer opens in a window of its own")
        return
    why = "no display" if spawn else "view.spawn is off"
    screen.say(f"no viewer is opened here ({why}); it runs without, and this shows it:")
    for line in view.address.splitlines():
        screen.say(f"  {line}")
