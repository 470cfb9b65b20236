"""The outputs of a configuration: results, view and status card."""

from __future__ import annotations

import datetime
import logging
from pathlib import Path
from typing import TYPE_CHECKING, Any

from acquire.frame import CameraInfo
from acquire.load_cell import LoadLog
from live.outputs.outputs import Outputs
from live.results import Results
from live.setup import Config, versions
from live.tell import Journal, Ledger, Screen, StatusCard
from live.view import RerunView
from live.view.rerun_view import spawn_viewer

if TYPE_CHECKING:
    from analysis import ZoiGrid
log = logging.getLogger(__name__)


def open_view(outputs: Outputs, config: Config, screen: Screen) -> None:
    """Open the viewer where there is a display; else say how to look."""
    view = outputs.view
    if view is None:
        return
    opened = config.view.spawn and view.port is not None and spawn_viewer(view.port) is not None
    if opened:
        screen.say("the viewer opens in a window of its own")
        return
    screen.say("no viewer is opened here (no display); it runs without, and this shows it:")
    for line in view.address.splitlines():
        screen.say(f"  {line}")


def make_outputs(
    config: Config,
    folder: Path,
    camera: CameraInfo,
    grid: ZoiGrid,
    loads: LoadLog,
    journal: Journal,
    ledger: Ledger,
    start: tuple[float, datetime.datetime],
) -> Outputs:
    """Results in ``folder`` and, where wanted, the view.

    Parameters
    ----------
    start : (monotonic s, UTC)
        Time zero of the files and curves.
    """

    monotonic, utc = start
    results = Results(
        folder,
        grid=grid,
        start_monotonic=monotonic,
        start_utc=utc.isoformat(),
        loads=loads,
        config=config.as_dict(),
        metadata=dict(config.metadata),
        versions=versions(),
        camera=camera,
        area_m2=config.specimen.area_m2,
    )
    view = _view(config, folder, camera, grid, monotonic, journal)
    return Outputs(results, view, journal, StatusCard(config.specimen, loads), ledger)


def _view(
    config: Config, folder: Path, camera: CameraInfo, grid: ZoiGrid, start_monotonic: float, journal: Journal
) -> Any:
    v = config.view
    if not (v.enabled or v.rrd):
        return None
    from live.view.rerun_view import ViewSetup

    setup = ViewSetup(
        title=folder.name,
        width=camera.width,
        height=camera.height,
        bits=camera.bits,
        grid=grid,
        start_monotonic=start_monotonic,
        area_m2=config.specimen.area_m2,
        axis="x" if config.specimen.axis == "x" else "y",
        strain_range=v.strain_range,
    )
    view = RerunView(setup, port=v.port if v.enabled else None, rrd=folder / "view.rrd" if v.rrd else None)
    journal.add_listener(view.event)
    return view
