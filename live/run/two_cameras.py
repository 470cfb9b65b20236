"""A test with two cameras, of both sides or two fields: each measured as a test of its own, one load cell and clock.

Each has its threads, its recording and its results, in a folder of its own. The kernel takes all cores for one
picture after the other, of whichever side.
"""

from __future__ import annotations

import datetime
import threading
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path

from acquire.errors import ConfigError
from acquire.events import EventKind
from live.config.loading import Config
from live.config.sides import FRONT
from live.pipeline.consumer import Compose
from live.pipeline.run_state import RunState
from live.pipeline.screen import Screen
from live.results.folder import make_folder
from live.run.control import ControlRefused
from live.run.live_run import TIME_IS_OVER, LiveRun, run_prepared
from live.run.outcome import Outcome, StopSignal
from live.run.prepared_run import PreparedRun, new_run_state, set_up
from live.setup.devices import open_two_rigs

DEFECT, LOSS, EXIT_INTERRUPTED = 1, 5, 130


@dataclass(frozen=True, slots=True, eq=False)
class OutcomeOfSides:
    """The result of a test with two cameras.

    Attributes
    ----------
    folder : Path
        Those of the sides are in it.
    sides : mapping of side to Outcome
    """

    folder: Path
    sides: Mapping[str, Outcome]

    @property
    def exit_code(self) -> int:
        """That of both; finished with loss where one side failed and the other did not."""
        codes = {outcome.exit_code for outcome in self.sides.values()}
        return (
            codes.pop()
            if len(codes) == 1
            else next((c for c in (DEFECT, EXIT_INTERRUPTED) if c in codes), LOSS)
        )


class BothRuns:
    """Both sides under one control (``live.run.control.Controls``); a side that has ended takes no commands.

    Parameters
    ----------
    runs : mapping of side to LiveRun
        That have begun; the first of them has the load cell, alarms and strain outputs.
    folder : Path
        Of the test.
    stop : StopSignal
        Ends both.
    """

    def __init__(self, runs: Mapping[str, LiveRun], folder: Path, stop: StopSignal) -> None:
        self.runs, self.folder, self._stop = runs, folder, stop

    @property
    def _running(self) -> list[LiveRun]:
        """Those that go on; both again when both have ended."""
        every = list(self.runs.values())
        return [run for run in every if run.grabber.running] or every

    @property
    def states(self) -> dict[str, RunState]:
        """Of each side."""
        return {name: run.run_state for name, run in self.runs.items()}

    @property
    def paused(self) -> bool:
        """Whether measuring is paused."""
        return self._running[0].paused

    @property
    def recording(self) -> bool:
        """Whether frames of every side that goes on are recorded."""
        return all(run.recording for run in self._running)

    @property
    def live(self) -> bool:
        """Whether the cameras are there now."""
        return self._running[0].live

    @property
    def run_state(self) -> RunState:
        """Of the first."""
        return next(iter(self.runs.values())).run_state

    def stop(self, reason: str) -> None:
        """End both cleanly, soon."""
        self._stop.request(reason)

    def command(self, kind: EventKind, note: str = "") -> str:
        """Carry out a command on both; a tare is one for both. Raises ControlRefused where no side carries it out."""
        if kind is EventKind.TARE:
            return self._running[0].command(kind, note)
        answers, refused = [], ControlRefused()
        for run in self._running:
            try:
                answers.append(run.command(kind, note))
            except ControlRefused as error:
                refused = error
        if not answers:
            raise refused
        return answers[0]


@dataclass(frozen=True, slots=True, eq=False)
class Side:
    """One side of a test to come.

    Attributes
    ----------
    config : Config
        Of ``live.config.sides.side_configs``.
    screen : Screen
    consumers : callable
        As of ``live.run.live_run.run_live``.
    """

    config: Config
    screen: Screen
    consumers: Compose


def run_two_cameras(
    sides: Mapping[str, Side],
    *,
    stop: StopSignal | None = None,
    on_start: Callable[[BothRuns], object] = lambda both: None,
) -> OutcomeOfSides:
    """Run a test with two cameras, the leading one first; ``on_start`` is called once both have begun.

    A camera that fails in the test leaves the other side measuring. One that cannot be opened, or gives no reference,
    ends the test: it did not begin.

    Raises
    ------
    ConfigError, DeviceError, DataError
        As ``live.run.live_run.run_live``.
    """
    stop, front = stop or StopSignal(), next(iter(sides.values())).config
    are_sides = FRONT in sides
    states = {
        name: new_run_state(side.config, side.screen, both_sides=are_sides) for name, side in sides.items()
    }
    sinks = [state.event_log.record for state in states.values()]
    rigs = open_two_rigs([side.config.camera for side in sides.values()], front.load, sinks)
    with ExitStack() as closing:
        for rig in rigs:
            closing.callback(rig.close)
        folder = make_folder(front.output.dir, datetime.datetime.now(datetime.UTC))
        prepared = {}
        for (name, side), rig in zip(sides.items(), rigs, strict=True):
            config = replace(side.config, output=replace(side.config.output, dir=str(folder / name)))
            prepared[name] = set_up(config, rig, states[name].event_log, side.screen, stop)
        begun: dict[str, LiveRun] = {}

        def begin(name: str, live: LiveRun) -> None:
            begun[name] = live
            if len(begun) == len(sides):
                on_start(BothRuns({name: begun[name] for name in sides}, folder, stop))

        return OutcomeOfSides(folder, _run(sides, _from_one_zero(prepared), states, stop, begin))


def _from_one_zero(prepared: Mapping[str, PreparedRun]) -> dict[str, PreparedRun]:
    """The same with the time zero of the first; raises ConfigError where the cameras have different clocks."""
    if len({run.rig.camera.info.clock == "nominal" for run in prepared.values()}) > 1:
        raise ConfigError("two cameras: one has nominal times and the other a clock; give two of one kind")
    start = next(iter(prepared.values())).start
    return {name: replace(run, start=start) for name, run in prepared.items()}


def _run(
    sides: Mapping[str, Side],
    prepared: Mapping[str, PreparedRun],
    states: Mapping[str, RunState],
    stop: StopSignal,
    begin: Callable[[str, LiveRun], None],
) -> dict[str, Outcome]:
    """Each side in a thread of its own, to the end of both; raises what a side raised."""
    lock = threading.Lock()

    def begin_in_turn(name: str, live: LiveRun) -> None:
        with lock:
            begin(name, live)

    def run(name: str) -> Outcome:
        side = sides[name]
        try:
            return run_prepared(
                prepared[name], states[name], side.screen, linked(stop), side.consumers,
                lambda live: begin_in_turn(name, live),
            )  # fmt: skip
        except BaseException:
            stop.request("the start failed")
            raise

    with ThreadPoolExecutor(len(sides)) as threads:
        running = {name: threads.submit(run, name) for name in sides}
    return {name: done.result() for name, done in running.items()}


def linked(both: StopSignal) -> StopSignal:
    """The stop of one side: it follows that of both, and stops both, except where its own time is over."""
    one = StopSignal()

    def pass_on() -> None:
        if one.reason != TIME_IS_OVER and not both.requested:
            both.request(one.reason)

    def follow() -> None:
        if not one.requested:
            one.request(both.reason)

    one.on_request(pass_on)
    both.on_request(follow)
    return one
