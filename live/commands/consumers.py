"""What tests have in common, measured live or replayed: their standard consumers, and what is done at the end.

The consumers are results, view and status card, in a live run also alarms and strain output; at the end there are
summaries, front and back put together, report, exit code.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from acquire.addresses import Options, parse_address
from acquire.errors import EXIT_WORDS, LOSS, PhasedicError
from acquire.events import EventKind, Level
from acquire.serial_line.ports import LineSettings
from acquire.text import Message
from live.commands.sides import TABLE, put_together
from live.config.cameras import BACK, FRONT
from live.config.figures import DEFAULT_CHANNELS, OF_LOAD, joint_channels
from live.config.gauges import gauge_colours, outlines
from live.config.listen_address import ListenAddress, read_token
from live.config.loading import Config
from live.pipeline.consumer import Compose, Consumer, RunInfo, Screen
from live.pipeline.run_state import RunState
from live.pipeline.snapshot import ChannelValues
from live.pipeline.timed.course import shown_names
from live.results.finished.figures_file import FILE
from live.results.sides import JointChannels
from live.results.summary import StatusCard
from live.results.writer import write_results
from live.run.alarms import ActionMeans, Alarm, AlarmWatch, actions_of
from live.run.strain_output import LineFormat, SerialOut, StrainOut, TcpOut, UdpOut
from live.ui.rerun.consumer import CardWriter, FiguresWriter, RerunConsumer
from live.ui.rerun.messages import ViewSetup
from live.ui.rerun.view import View, spawn_viewer
from live.ui.terminal.screen import CamerasScreen
from live.ui.terminal.summary import print_summary

if TYPE_CHECKING:
    from live.replay.replay import Replayed
    from live.run.outcome import Outcome

OUTPUT_NAME = "strain out"


def signals_of(
    about: RunInfo, run_state: RunState, screen: Screen, joint: JointChannels | None
) -> list[Consumer]:
    """Alarms and strain outputs of a live run; none for a replay. ``joint``: of a test of front and back.

    Raises
    ------
    ConfigError, DeviceError
        A port is taken or missing, or needs a token.
    """
    if about.end is None:
        return []
    outputs: list[StrainOut] = []
    with ExitStack() as opened:
        for make in (_tcp, _udp, _serial):
            out = make(about.config, _lines(about, run_state, joint))
            if out is not None:
                opened.callback(out.end)
                outputs.append(out)
                out.tell = partial(_emit, run_state, out.name)
                told = Message(
                    "{name}: strains and forces {whom}; it takes no commands", out.name, out.to_whom
                )
                screen.print(told)
        opened.pop_all()
    means = ActionMeans(screen, about.end, outputs)
    alarms = [Alarm(config, actions_of(config, means)) for config in about.config.alarm]
    return [*_alarm_watch(alarms, about, run_state, joint), *outputs]


def _emit(run_state: RunState, source: str, text: str, level: Level) -> None:
    run_state.event_log.emit(EventKind.VIEW, source, text, level)


def _alarm_watch(
    alarms: Sequence[Alarm], about: RunInfo, run_state: RunState, joint: JointChannels | None
) -> list[Consumer]:
    if not alarms:
        return []
    values = ChannelValues(about.start.monotonic, run_state)
    return [AlarmWatch(alarms, values, run_state, joint=joint)]


def _lines(about: RunInfo, run_state: RunState, joint: JointChannels | None) -> LineFormat:
    config, start = about.config, about.start.monotonic
    gauges = tuple(f"{prefix}gauge_{name}" for name in config.gauges for prefix in ("", "sigma_"))
    both = () if joint is None else joint_channels(config.gauges)
    wanted = config.strain_out.channels or (*DEFAULT_CHANNELS, *gauges, *both)
    absent = {
        *(() if run_state.with_load else OF_LOAD),
        *(() if config.specimen.area_m2 else ("stress_MPa",)),
    }
    channels = [channel for channel in wanted if channel not in absent]
    return LineFormat(ChannelValues(start, run_state, joint), channels, config.strain_out.format)


def _tcp(config: Config, lines: LineFormat) -> StrainOut | None:
    if config.strain_out.tcp is None:
        return None
    address = ListenAddress.parse(config.strain_out.tcp)
    return TcpOut(
        address.listen(OUTPUT_NAME), read_token(address, config.operate.token_file, OUTPUT_NAME), lines
    )


def _udp(config: Config, lines: LineFormat) -> StrainOut | None:
    if config.strain_out.udp is None:
        return None
    address = ListenAddress.parse(config.strain_out.udp)
    return UdpOut(address.host, address.port, lines)


def _serial(config: Config, lines: LineFormat) -> StrainOut | None:
    if config.strain_out.serial is None:
        return None
    address = parse_address(config.strain_out.serial)
    options = Options(address)
    baud = options.integer("baud", 115200, minimum=50, maximum=12_000_000)
    options.done()
    url = f"{address.scheme}:{address.target}" if address.scheme else address.target
    return SerialOut(LineSettings(url, baud), lines)


def standard_consumers(
    screen: Screen, more: Sequence[Consumer] = (), joint: JointChannels | None = None
) -> Compose:
    """The consumers of a configuration, and ``more``, for ``run_live`` and ``replay``.

    ``joint`` gives alarms and strain outputs the channels of front and back together.

    The result raises ConfigError or DeviceError if a port is taken or missing, or needs a token, and DataError if a
    file of the results exists already or cannot be made.
    """

    def compose(about: RunInfo, run_state: RunState) -> Sequence[Consumer]:
        signals = signals_of(about, run_state, screen, joint)
        return [*write_results(about, run_state), *_view_consumers(about, run_state, screen), *more, *signals]

    return compose


def _view_consumers(about: RunInfo, run_state: RunState, screen: Screen) -> list[Consumer]:
    """The view, and the consumers that update its card and figures."""
    view = _view(about, run_state, screen)
    if view is None:
        return []
    card = StatusCard(about.config.specimen, run_state.loads)
    return [CardWriter(view, card, run_state), FiguresWriter(view, run_state), RerunConsumer(view, run_state)]


def _view(about: RunInfo, run_state: RunState, screen: Screen) -> View | None:
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
        colours=gauge_colours(about.config.gauges),
        light=v.light,
        picture_hz=1.0 if v.light else 5.0,
        whole=shown_names(about.config.output.response),
        scale="symmetric" if v.scale == "symmetric" else "automatic",
    )
    rrd = about.folder / "view.rrd" if v.rrd else None

    tell = partial(_emit, run_state, "view")

    def serving(view: View) -> None:
        run_state.health.view_port = view.port
        _announce(view, v.spawn, screen, run_state)

    port = v.port if v.enabled else None
    return View(setup, port=port, rrd=rrd, notify=tell, on_serving=serving)


def _announce(view: View, spawn: bool, screen: Screen, run_state: RunState) -> None:
    """Open the viewer if there is a display; else print how to open it."""
    trouble = partial(_emit, run_state, "view", level="warning")
    if spawn and view.port is not None and spawn_viewer(view.port, trouble) is not None:
        screen.print(Message("the viewer opens in its own window"))
        return
    why = Message("no display") if spawn else Message("view.spawn is off")
    screen.print(Message("no viewer is opened ({why}); the test runs without it. To open one:", why))
    for line in view.instructions.splitlines():
        screen.print(f"  {line}")


def finish_test(
    cameras: Mapping[str, Outcome | Replayed],
    lines: Mapping[str, Sequence[str]],
    folder: Path,
    code: int,
    screen: Screen,
    *,
    verbose: bool = False,
) -> int:
    """Print the summary of each camera with its ``lines``, and what is of all; the exit code, which was ``code``.

    A report is made where that is configured: one, of all cameras. Figures or a report that could not be written are a
    loss.
    """
    every, several = CamerasScreen(screen), len(cameras) > 1
    report = next(iter(cameras.values())).config.output.report
    for name, one in cameras.items():
        own, alone = every.of(name), report and not several
        print_summary(
            own, one.run_state, one.test, one.folder, lines[name], verbose=verbose, with_report=alone
        )
        if not (one.folder / FILE).exists():
            code = code or LOSS
    if several:
        screen.print()
    if FRONT in cameras:
        try:
            put_together(folder / FRONT, folder / BACK, folder / TABLE, screen)
        except PhasedicError as error:
            screen.print(Message("warning: front and back were not put together: {why}", error))
            code = code or LOSS
    if report:
        from live.commands.report import write_report

        if write_report(folder, screen):
            code = code or LOSS
    if code in EXIT_WORDS:
        screen.print(Message("exit code {code}: {words}", code, EXIT_WORDS[code]))
    return code
