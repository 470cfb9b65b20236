"""What the commands ``run``, ``replay`` and ``devices`` do; printing and signals are here."""

from __future__ import annotations

import argparse
import contextlib
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from types import FrameType

from live.arguments import overrides
from live.config import load_config
from live.run_live import LiveRun, Outcome
from live.status import Screen
from live.summary import file_lines, summary_lines
from live.view_viewer import rerun_command

EXIT_WORDS = {
    1: "a defect of phasedic, see the log",
    3: "the camera was lost before the end",
    5: "finished with loss; the ledger and the events tell what is missing",
    130: "interrupted; everything was closed cleanly",
}


@contextlib.contextmanager
def signals(stop: Callable[[], None], say: Callable[[str], None]) -> Iterator[None]:
    """SIGINT and SIGTERM call ``stop`` (the third time they kill); a lost terminal is ignored."""
    times = 0

    def handle(number: int, frame: FrameType | None) -> None:
        nonlocal times
        times += 1
        if times > 2:
            signal.signal(number, signal.SIG_DFL)
            signal.raise_signal(number)
        say("closing the files ..." if times == 1 else "still closing; once more ends it at once")
        stop()

    before = {number: signal.signal(number, handle) for number in (signal.SIGINT, signal.SIGTERM)}
    before[signal.SIGHUP] = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def run(arguments: argparse.Namespace) -> int:
    """``phasedic run``."""
    config = load_config(Path(arguments.config) if arguments.config else None, overrides(arguments))
    screen = Screen()
    live = LiveRun(config, screen)
    outcome = run_to_the_end(live, screen)
    conclude(outcome, live, screen)
    return outcome.exit_code


def run_to_the_end(live: LiveRun, screen: Screen) -> Outcome:
    """Run with signals, keyboard and viewer attached."""
    from live.operator import listen

    with signals(lambda: live.stop("interrupted"), screen.say):
        listen(live, sys.stdin, screen)
        return live.run()


def conclude(outcome: Outcome, live: LiveRun, screen: Screen) -> None:
    """Print the summary, the ledger, the losses and the files."""
    screen.say()
    for line in summary_lines(outcome.outputs.history, outcome.loads, live.config.specimen):
        screen.say(line)
    screen.say(outcome.ledger.line())
    troubles = live.journal.events("warning", "error")
    if troubles:
        screen.say(
            f"{len(troubles)} warnings and errors, the last: {troubles[-1].source}: {troubles[-1].text}"
        )
    for line in file_lines(outcome.folder):
        screen.say(line)
    rrd = outcome.folder / "view.rrd"
    if rrd.exists():
        screen.say(f"look at it again with: {rerun_command()} {rrd}")
    if outcome.exit_code in EXIT_WORDS:
        screen.say(f"exit code {outcome.exit_code}: {EXIT_WORDS[outcome.exit_code]}")


def replay_command(arguments: argparse.Namespace) -> int:
    """``phasedic replay``."""
    from live.replay import ReplayRequest, replay

    request = ReplayRequest(
        source=arguments.source,
        as_measured=arguments.as_measured,
        start_s=arguments.start_s,
        end_s=arguments.end_s,
        reference=arguments.reference,
        config_file=Path(arguments.config) if arguments.config else None,
        overrides=overrides(arguments),
    )
    screen, stopping = Screen(), threading.Event()
    with signals(stopping.set, screen.say):
        done = replay(request, screen, stopping)
    screen.say()
    for line in [
        *summary_lines(done.outputs.history, done.loads, done.config.specimen),
        *file_lines(done.folder),
    ]:
        screen.say(line)
    return done.exit_code


def average(arguments: argparse.Namespace) -> int:
    """``phasedic average``: a dark frame (lens covered) or a flat frame (evenly lit)."""
    from acquire.burst import average_bursts
    from acquire.errors import DataError
    from acquire.mean_image import save_mean
    from live.rig import open_rig

    screen = Screen()
    crop = tuple(arguments.crop) if arguments.crop else None
    rig = open_rig(arguments.camera, "none:", lambda event: screen.say(event.text), crop=crop)
    try:
        with rig.camera:
            burst = next(average_bursts(rig.camera, arguments.frames), None)
    finally:
        rig.close()
    if burst is None:
        raise DataError(f"{arguments.camera}: gave fewer than {arguments.frames} frames without a gap")
    save_mean(burst.mean, Path(arguments.out))
    noise = f", noise of one {burst.noise:.2f} GL" if burst.n > 1 else ""
    screen.say(f"{arguments.out}: {burst.n} frames, mean {burst.mean.mean():.1f} GL{noise}")
    return 0


def devices(arguments: argparse.Namespace) -> int:
    """``phasedic devices``."""
    from acquire.devices import list_cameras
    from acquire.serial_ports import list_serial_ports

    cameras, ports = list_cameras(), list_serial_ports()
    print("cameras:" if cameras else "cameras: none found (V4L2 devices are /dev/video*)")
    for camera in cameras:
        print(camera.text())
    print("serial ports:" if ports else "serial ports: none found")
    for port in ports:
        print(port.text())
    return 0
