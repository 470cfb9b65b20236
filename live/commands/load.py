"""The commands around the load cell and recorded files: load-check, identify, load-calibrate, recover."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path

from acquire.errors import ConfigError
from acquire.events import Event

Say = Callable[[str], None]
Ask = Callable[[str], str]

NOT_READY = 6
GRAVITY = 9.80665  # m/s^2


def _tell(say: Say) -> Callable[[Event], None]:
    return lambda event: say(f"{event.level}: {event.text}")


def load_check(arguments: argparse.Namespace, say: Say = print) -> int:
    """``phasedic load-check --load ADDRESS [--seconds 10]``; 0 when ready for a test, 6 when not."""
    from acquire.load_cell import open_load_cell
    from acquire.load_cell.check import listen, report, report_lines
    from live.setup import register_simulators

    register_simulators()

    cell = open_load_cell(arguments.load, _tell(say))
    say(f"listening to {cell.info.name} for {arguments.seconds:g} s ...")
    found = report(listen(cell, arguments.seconds), cell.info)
    for line in report_lines(found):
        say(line)
    say("ready" if found.ready else "not ready")
    return 0 if found.ready else NOT_READY


def identify(arguments: argparse.Namespace, say: Say = print) -> int:
    """``phasedic identify DEVICE [--ask]``; 0 when something was recognised, 6 when not."""
    from acquire.serial_line.identify import listen

    for baud, heard, finding in listen(arguments.device):
        shown = heard[:60].decode("ascii", "backslashreplace")
        say(f"{baud:7} baud: {len(heard)} bytes {shown!r}" if heard else f"{baud:7} baud: silence")
        if finding is not None:
            _propose(finding.address, finding.remark, say)
            return 0
    if arguments.ask:
        return _ask_all(arguments.device, say)
    say("nothing recognised; --ask sends queries to this port (only if no machine there can move)")
    return NOT_READY


def _ask_all(device: str, say: Say) -> int:
    from acquire.serial_line.identify import ask, questions

    asked = questions(device)
    say("will send, one after the other:")
    for question in asked:
        line = question.line
        say(f"  {question.data!r}  at {line.baud} {line.bytesize}{line.parity}1 ({question.protocol})")
    for question in asked:
        finding = ask(question)
        say(f"  {question.protocol}: {'answers' if finding else 'no answer'}")
        if finding is not None:
            _propose(finding.address, finding.remark, say)
            return 0
    say("no answer; check cable, speed and the device's own settings (docs/load-cells.md)")
    return NOT_READY


def _propose(address: str, remark: str, say: Say) -> None:
    say(f"use  --load '{address}'")
    if remark:
        say(f"but  {remark}")


def load_calibrate(arguments: argparse.Namespace, say: Say = print, ask: Ask = input) -> int:
    """``phasedic load-calibrate --load ADDRESS (--mass KG | --force N) --out FILE [--seconds 3]``.

    Reads no load, the known load, no load again; asks before each and before the result is kept.
    6 when it was not accepted.
    """
    from acquire.load_cell import open_load_cell
    from acquire.load_cell.calibration import Point, fit, point, save
    from acquire.load_cell.check import listen
    from live.setup import register_simulators

    register_simulators()
    if (arguments.mass is None) == (arguments.force is None):
        raise ConfigError("give the known load: --mass in kg, or --force in N")
    known_N = arguments.force if arguments.mass is None else arguments.mass * GRAVITY
    address = _raw(arguments.load)

    def read(force_N: float, what: str) -> Point:
        ask(f"{what}, wait until it is still, then press Enter ")
        samples = listen(open_load_cell(address, _tell(say)), arguments.seconds)
        found = point(force_N, [sample.force for sample in samples])
        say(f"  {found.value:.8g} on the line (noise {found.noise:.3g}, {found.n} readings)")
        return found

    points = [read(0.0, "take off all load"), read(known_N, f"put on {known_N:.6g} N")]
    points.append(read(0.0, "take off all load again"))
    found = fit(points)
    say(f"gain {found.gain:.8g} N per unit, zero {found.zero:.8g}, residual {found.residual_N:.3g} N")
    if ask("accept? (yes/no) ").strip().lower() not in ("y", "yes"):
        say("not kept")
        return NOT_READY
    save(found, Path(arguments.out), arguments.load)
    say(f"kept in {arguments.out}; use it with calibration={arguments.out} in the address")
    return 0


def _raw(address: str) -> str:
    """The address with what stands on the line as value: no unit, no sign, no earlier calibration."""
    body, mark, settings = address.partition("?")
    dropped = ("gain", "zero", "sign", "unit", "calibration", "capacity", "max_step", "mass_reads_force")
    kept = [part for part in settings.split("&") if mark and part.partition("=")[0] not in dropped]
    return f"{body}?{'&'.join([*kept, 'gain=1', 'sign=1'])}"
