"""Live tests and replays from a program: as ``phasedic run`` and ``phasedic replay``, without keyboard and signals."""

from __future__ import annotations

import queue
import threading
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from live.commands.consumers import standard_consumers
from live.config.loading import Config, load_config
from live.pipeline.consumer import Consumer, Policy, Screen
from live.pipeline.measurement import Measurement
from live.run.live_run import OnStart, run_live
from live.run.outcome import Outcome, StopSignal
from live.setup.region import located
from live.ui.terminal.screen import TerminalScreen

if TYPE_CHECKING:
    from live.replay.replay import Replayed

Settings = Config | Mapping[str, Any] | str | Path
LOOK_S = 0.1  # between two looks whether the loop was left


def run(
    config: Settings,
    consumers: Sequence[Consumer] = (),
    *,
    screen: Screen | None = None,
    stop: StopSignal | None = None,
    on_start: OnStart = lambda live: None,
) -> Outcome:
    """Run a live test with one camera: results, recording and view as by ``phasedic run``, and ``consumers``.

    Parameters
    ----------
    config : Config, mapping of "section.key" to value, or path of a TOML file
    consumers : sequence of Consumer
        Beside the standard ones.
    screen : Screen, optional
        Where lines for a person go; by default the terminal.
    stop : StopSignal, optional
        Ends the test from any thread.
    on_start : callable taking the LiveRun
        Called once when the test has begun.

    Raises
    ------
    ConfigError, DeviceError, DataError
        The start failed; the message names key, device or file.
    """
    screen = screen or TerminalScreen()
    with located(_config(config), screen) as found:
        made = standard_consumers(screen, consumers)
        return run_live(found, screen, stop=stop, consumers=made, on_start=on_start)


def replay(
    source: str | Path,
    config: Settings = MappingProxyType({}),
    consumers: Sequence[Consumer] = (),
    *,
    forces: str | Path | None = None,
    screen: Screen | None = None,
) -> Replayed:
    """Measure a session or pictures as ``phasedic replay``; parameters and errors as of ``run``.

    Parameters
    ----------
    source : str or Path
        Folder of a run, session, folder of pictures or an address.
    forces : str or Path, optional
        File with the forces of pictures.
    """
    from live.replay import replay as replays
    from live.replay.source import ReplayRequest

    if isinstance(config, Config):
        raise TypeError("a replay has its own configuration; give a mapping, or the path of a TOML file")
    file, given = (None, dict(config)) if isinstance(config, Mapping) else (Path(config), {})
    screen = screen or TerminalScreen()
    request = ReplayRequest(str(source), file, given, forces=None if forces is None else Path(forces))
    return replays.replay(request, screen, threading.Event(), standard_consumers(screen, consumers))


def measurements(config: Settings, *, screen: Screen | None = None) -> Iterator[Measurement]:
    """The measurements of a live test as they come, for a loop; leaving the loop ends the test cleanly.

    A loop that is slower than the test gets the newest; results and recording have all. Parameters and errors as of
    ``run``.
    """
    stop, passing = StopSignal(), _Passing()
    with ThreadPoolExecutor(1, "test") as pool:
        test = pool.submit(run, config, [passing], screen=screen, stop=stop)
        try:
            while not test.done():
                with suppress(queue.Empty):
                    yield passing.queue.get(timeout=LOOK_S)
            while not passing.queue.empty():
                yield passing.queue.get()
            test.result()
        finally:
            passing.left.set()
            stop.request("the loop was left")


class _Passing(Consumer):
    """Passes measurements on to the loop."""

    name, policy = "loop", Policy.NEWEST

    def __init__(self) -> None:
        self.queue: queue.Queue[Measurement] = queue.Queue(1)
        self.left = threading.Event()

    def measurement(self, measurement: Measurement) -> None:
        waiting = True
        while waiting and not self.left.is_set():
            with suppress(queue.Full):
                self.queue.put(measurement, timeout=LOOK_S)
                waiting = False


def _config(config: Settings) -> Config:
    if isinstance(config, Config):
        return config
    return load_config(None, config) if isinstance(config, Mapping) else load_config(Path(config), {})
