"""The standard consumers of a test: results, view and status card; alarms and strain output of a live run."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from acquire.events import EventKind, Level
from live.measure import Screen
from live.outputs import About, Compose, Consumer, write_results
from live.setup import outlines
from live.signals import signals_of
from live.tell import Books, StatusCard
from live.view import View, ViewSetup, spawn_viewer
from live.view.consumers import CardWriter, FiguresWriter, Watching


def standard_consumers(screen: Screen, more: Sequence[Consumer] = ()) -> Compose:
    """For ``run_live`` and ``replay``: what a configuration asks for, and ``more`` of one's own.

    Raises, when it is called, ConfigError or DeviceError where a port is taken, not there, or needs a token, and
    DataError where a file of the results exists already, or cannot be made.
    """

    def compose(about: About, books: Books) -> Sequence[Consumer]:
        signals = signals_of(about, books, screen)
        return [*write_results(about, books), *_shown(about, books, screen), *more, *signals]

    return compose


def _shown(about: About, books: Books, screen: Screen) -> list[Consumer]:
    """The view, and what keeps its words and figures new."""
    view = _view(about, books, screen)
    if view is None:
        return []
    card = StatusCard(about.config.specimen, books.loads)
    return [CardWriter(view, card, books), FiguresWriter(view, books), Watching(view, books)]


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
