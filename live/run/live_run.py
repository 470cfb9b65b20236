"""A live test: devices, cameras and outputs joined by one stream.

Threads: grab, record and measure of each camera (``camera_run``), load (``sources``), and one for each consumer
that may block. A test with several cameras is as one with a single camera, each with a name and a folder of its own;
load cell, clock and commands are those of all.
"""

from __future__ import annotations

import datetime
import time
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path

from acquire.errors import ConfigError
from acquire.events import EventKind, Level
from acquire.load_cell import LoadCell
from acquire.load_sample import LoadSample
from live.config.cameras import FRONT
from live.config.loading import Config
from live.pipeline.consumer import Compose, Screen
from live.pipeline.run_state import RunState
from live.results.folder import make_folder
from live.results.writer import write_results
from live.run.camera_run import CameraRun
from live.run.control import ControlRefused, TareControl
from live.run.outcome import Outcome, OutcomeOfTest, StopSignal
from live.run.prepared_run import PreparedRun, new_run_state, set_up
from live.run.sources import LoadSource
from live.setup.devices import Rig, open_rigs
from live.stream.stream import Stream


class LiveRun:
    """A test: entering it starts the threads, leaving it closes everything.

    It carries out commands (``live.run.control.Controls``) from any thread; a camera that has ended takes none.

    Parameters
    ----------
    cameras : mapping of str to CameraRun
        By name; the first of them has alarms and strain outputs.
    load : LoadCell
        Of all cameras.
    folder : Path
        Of the files of the test.
    stream : Stream
    stop : StopSignal
    """

    def __init__(
        self, cameras: Mapping[str, CameraRun], load: LoadCell, folder: Path, stream: Stream, stop: StopSignal
    ) -> None:
        self.cameras, self.folder, self._load, self._stop = cameras, folder, load, stop
        self._load_source = LoadSource(load, stream)
        self._tares = TareControl(load, self, time.monotonic)
        self.run_state.event_log.add_listener(self._tares.take_event)

    @property
    def has_measured(self) -> bool:
        """Whether any camera has measured."""
        return any(run.has_measured for run in self.cameras.values())

    @property
    def latest_load(self) -> LoadSample | None:
        """The newest sample."""
        return self.run_state.loads.latest

    def emit(self, kind: EventKind, source: str, text: str, level: Level) -> None:
        """Put an event into the log of every camera that goes on."""
        for run in self._running:
            run.run_state.event_log.emit(kind, source, text, level)

    # -- what may be called from other threads ------------------------------------------------

    @property
    def first(self) -> CameraRun:
        """The run of the leading camera."""
        return next(iter(self.cameras.values()))

    @property
    def _running(self) -> list[CameraRun]:
        """Those that go on; all again when all have ended."""
        every = list(self.cameras.values())
        return [run for run in every if run.running] or every

    @property
    def paused(self) -> bool:
        """Whether measuring is paused."""
        return self._running[0].paused

    @property
    def recording(self) -> bool:
        """Whether frames of every camera that goes on are recorded."""
        return all(run.recording for run in self._running)

    @property
    def live(self) -> bool:
        """Whether the cameras are there now; else their pictures are recorded."""
        return self._running[0].live

    @property
    def rig(self) -> Rig:
        """The devices of the first camera."""
        return self.first.rig

    @property
    def run_state(self) -> RunState:
        """Events, counts, loads and history of the first camera so far."""
        return self.first.run_state

    @property
    def states(self) -> dict[str, RunState]:
        """The state of each camera."""
        return {name: run.run_state for name, run in self.cameras.items()}

    def stop(self, reason: str) -> None:
        """End the test cleanly, soon."""
        self._stop.request(reason)

    def command(self, kind: EventKind, note: str = "") -> str:
        """Carry out a command on every camera that goes on; a tare is one for all.

        Raises
        ------
        ControlRefused
            No camera carries it out.
        """
        if kind is EventKind.TARE:
            return self._tares.tare(note)
        answers, refused = [], ControlRefused()
        for run in self._running:
            try:
                answers.append(run.command(kind, note))
            except ControlRefused as error:
                refused = error
        if not answers:
            raise refused
        return answers[0]

    # -- the run ------------------------------------------------------------------------------

    def __enter__(self) -> LiveRun:
        with ExitStack() as opened:
            for run in self.cameras.values():
                opened.enter_context(run.rig.camera)
                self._stop.on_request(run.rig.camera.stop)
            opened.enter_context(self._load)
            for run in self.cameras.values():
                run.begin()
            self._load_source.start()
            for run in self.cameras.values():  # no camera gives frames before all are open
                run.source.start()
            opened.pop_all()
        return self

    def wait(self) -> None:
        """Measure until all cameras have ended; raises PhasedicError where the start has failed."""
        for run in self.cameras.values():
            run.measurer.start()  # what came before has waited
        for run in self.cameras.values():
            run.measurer.join()

    def __exit__(self, *_: object) -> None:
        """End all threads and close the devices, whatever happened before: the load last, for the last forces."""
        for run in self.cameras.values():
            run.stop_frames()
        self._load.stop()
        for run in self.cameras.values():
            run.drain()
        self._load_source.join()
        self._load.close()


OnStart = Callable[[LiveRun], object]
"""Called once when the test has begun, to attach keyboard and other controls."""


@dataclass(frozen=True, slots=True, eq=False)
class CameraOfTest:
    """One camera of a test to come.

    Attributes
    ----------
    config : Config
    screen : Screen
    consumers : callable taking RunInfo and RunState
        As of ``run_live``.
    """

    config: Config
    screen: Screen
    consumers: Compose


def run_live(
    config: Config,
    screen: Screen,
    *,
    stop: StopSignal | None = None,
    consumers: Compose = write_results,
    on_start: OnStart = lambda live: None,
) -> Outcome:
    """Run a test with one camera from opening the devices to closing the files.

    Parameters
    ----------
    config : Config
    screen : Screen
    stop : StopSignal, optional
        Ends the test from any thread, also while the devices are opened.
    consumers : callable taking RunInfo and RunState
        Makes the consumers of the test; ``live.commands.consumers`` has the standard ones.
    on_start : callable taking the LiveRun
        Called once when the test has begun, to attach keyboard and other controls.

    Raises
    ------
    ConfigError, DeviceError, DataError
        The start failed; whatever was recorded by then is closed and readable.
    """
    camera = CameraOfTest(config, screen, consumers)
    return run_cameras({"": camera}, stop=stop, on_start=on_start).cameras[""]


def run_cameras(
    cameras: Mapping[str, CameraOfTest],
    *,
    stop: StopSignal | None = None,
    on_start: OnStart = lambda live: None,
) -> OutcomeOfTest:
    """Run a test with any number of cameras, the leading one first; parameters and errors as of ``run_live``.

    A camera that fails in the test leaves the others measuring. One that cannot be opened, or gives no reference,
    ends the test: it did not begin.
    """
    stop, first = stop or StopSignal(), next(iter(cameras.values())).config
    states = {
        name: new_run_state(one.config, one.screen, both_sides=FRONT in cameras)
        for name, one in cameras.items()
    }
    sinks = [state.event_log for state in states.values()]
    opened = open_rigs([one.config.camera for one in cameras.values()], first.load, sinks)
    rigs = dict(zip(cameras, opened, strict=True))
    with ExitStack() as closing:
        for rig in rigs.values():
            closing.callback(rig.close)
        folder, configs = _folders(cameras)
        prepared = {
            name: set_up(configs[name], rigs[name], states[name].event_log, one.screen, stop)
            for name, one in cameras.items()
        }
        if len(cameras) == 1:
            folder = next(iter(prepared.values())).folder
        runs = _run(cameras, _from_one_zero(prepared), states, folder, stop, on_start)
        outcomes = {name: run.outcome() for name, run in runs.items()}
        where = next(iter(outcomes.values())).folder
        return OutcomeOfTest(where if len(runs) == 1 else where.parent, outcomes)


def _folders(cameras: Mapping[str, CameraOfTest]) -> tuple[Path, dict[str, Config]]:
    """The folder of the test, made where it has several cameras, and configurations with a folder for each in it."""
    configs = {name: one.config for name, one in cameras.items()}
    first = next(iter(configs.values()))
    if len(cameras) == 1:
        return Path(), configs
    folder = make_folder(first.output.dir, datetime.datetime.now(datetime.UTC))
    return folder, {
        name: replace(config, output=replace(config.output, dir=str(folder / name)))
        for name, config in configs.items()
    }


def _from_one_zero(prepared: Mapping[str, PreparedRun]) -> dict[str, PreparedRun]:
    """The same with the time zero of the first; raises ConfigError where the cameras have different clocks."""
    if len({run.rig.camera.info.clock == "nominal" for run in prepared.values()}) > 1:
        raise ConfigError(
            "one camera has nominal times and another a clock; give cameras of one kind, or one alone"
        )
    start = next(iter(prepared.values())).start
    return {name: replace(run, start=start) for name, run in prepared.items()}


def _run(
    cameras: Mapping[str, CameraOfTest],
    prepared: Mapping[str, PreparedRun],
    states: Mapping[str, RunState],
    folder: Path,
    stop: StopSignal,
    on_start: OnStart,
) -> dict[str, CameraRun]:
    """The test itself; outputs and recordings are closed in any case, the recordings last, with all events."""
    stream = Stream()
    runs: dict[str, CameraRun] = {}
    with ExitStack() as closing:
        for name, one in cameras.items():
            for line in prepared[name].announcement():
                one.screen.print(line)
            run = CameraRun(name, prepared[name], states[name], one.screen, stop, stream, one.consumers)
            with ExitStack() as failed:
                failed.callback(run.outputs.end)
                run.open_recording()
                failed.pop_all()
            runs[name] = run
            closing.callback(run.close)
        load = next(iter(prepared.values())).rig.load
        with LiveRun(runs, load, folder, stream, stop) as live:
            on_start(live)
            live.wait()
    return runs
