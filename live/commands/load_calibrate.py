"""``phasedic load-calibrate``: measure no load, a known load and no load again, and save the calibration."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from acquire.addresses import parse_address, with_setting
from acquire.errors import NOT_READY, ConfigError, DataError
from acquire.load_cell import calibration, check, stillness
from acquire.load_sample import LoadFlag, LoadSample
from acquire.text import Message, about, word
from live.commands.options import POSITIVE, number
from live.setup.devices import open_load
from live.ui.terminal.screen import print_line
from live.words.language import told

PrintLine = Callable[[str], None]
Ask = Callable[[str], str]

GRAVITY = 9.80665  # m/s^2
MAX_TRIES = 3  # for each point


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``phasedic load-calibrate``."""
    parser.add_argument("--load", required=True, metavar="ADDRESS", help="address of the load cell")
    parser.add_argument("--mass", type=POSITIVE, metavar="KG", help="the known load as a mass")
    parser.add_argument(
        "--force", type=number(), metavar="N", help="the known load as a force, N; negative in compression"
    )
    parser.add_argument("--out", required=True, metavar="FILE", help="file for the calibration")
    words = "ask nothing: take the three readings at once and accept the result (a program moves the load)"
    parser.add_argument("--yes", action="store_true", help=words)
    parser.add_argument(
        "--seconds",
        type=number(0.1, 3600),
        default=3.0,
        metavar="S",
        help="duration of each reading (default 3)",
    )


def _asked(question: str) -> str:
    """The answer of a person, or a line of standard input."""
    try:
        return input(question)
    except EOFError:
        raise ConfigError(
            "load-calibrate asks before each reading, and standard input has ended: run it in a terminal, or with --yes"
        ) from None


def _agree(question: str) -> str:
    return "yes"


def command(arguments: argparse.Namespace, print_line: PrintLine = print_line, ask: Ask = _asked) -> int:
    """``phasedic load-calibrate --load ADDRESS (--mass KG | --force N) --out FILE [--seconds 3]``.

    Asks before each of the three readings and before it saves the result; 6 if the result is not accepted. A simulated
    load cell gets its load by itself.
    """
    ask = _agree if arguments.yes else ask
    if (arguments.mass is None) == (arguments.force is None):
        raise ConfigError("give the known load: --mass in kg, or --force in N")
    known_N = arguments.force if arguments.mass is None else arguments.mass * GRAVITY
    simulated = parse_address(arguments.load).scheme == "sim"
    if simulated:
        print_line(Message("simulated: the known load is put on and taken off by the simulation"))
    readings = _Readings(arguments.load, arguments.seconds, simulated, print_line, ask)
    points = [
        readings.point(0.0, Message("take off all load")),
        readings.point(known_N, Message("put on {force:.6g} N", known_N)),
        readings.point(0.0, Message("take off all load again")),
    ]
    found = calibration.fit(points)
    print_line(
        Message(
            "gain {gain:.8g} N per unit, zero {zero:.8g}, residual {residual:.3g} N",
            *(found.gain, found.zero, found.residual_N),
        )
    )
    if ask(told(Message("accept? (yes/no) "))).strip().lower() not in ("y", "yes"):
        print_line(Message("not kept"))
        return NOT_READY
    calibration.save(found, Path(arguments.out), arguments.load)
    print_line(Message("kept in {path}; use it with calibration={path} in the address", arguments.out))
    return 0


@dataclass(frozen=True, slots=True)
class _Readings:
    """Readings of a load cell under known loads, each asked for until it is fit, ``MAX_TRIES`` times."""

    load: str
    seconds: float
    simulated: bool
    print_line: PrintLine
    ask: Ask

    def point(self, force_N: float, what: str) -> calibration.Point:
        """A point of the calibration; raises DataError where no reading was fit."""
        address = _raw(self.load)
        address = with_setting(address, "weight_N", force_N) if self.simulated else address
        for _ in range(MAX_TRIES):
            self.ask(told(Message("{what}, wait until it is still, then press Enter ", what)))
            cell = open_load(address, lambda event: self.print_line(about(word(event.level), event.text)))
            samples = check.listen(cell, self.seconds).samples
            why_not = _unfit(samples)
            if not why_not:
                found = calibration.point(force_N, [sample.force for sample in samples])
                self.print_line(
                    Message(
                        "  {value:.8g} on the line (noise {noise:.3g}, {n} readings)",
                        *(found.value, found.noise, found.n),
                    )
                )
                return found
            self.print_line(Message("  not taken: {why}", why_not))
        raise DataError(
            "{load}: {n} times {why}; look at it with 'phasedic load-check'", self.load, MAX_TRIES, why_not
        )


def _unfit(samples: Sequence[LoadSample]) -> str:
    """Why these samples give no point of a calibration; "" if they do."""
    if any(sample.flags & (LoadFlag.OVERLOAD | LoadFlag.UNDERLOAD) for sample in samples):
        return Message("the cell was in overload or saturated")
    good = [sample for sample in samples if not math.isnan(sample.force)]
    found = stillness([sample.t for sample in good], [sample.force for sample in good])
    if found.n < 3 or found.still:
        return "" if found.n else Message("no reading had a value")
    return Message("the load moved, by {range:.4g} on the line", found.range_N)


def _raw(address: str) -> str:
    """The address for values as sent by the device: without unit, sign and earlier calibration."""
    body, mark, settings = address.partition("?")
    dropped = ("gain", "zero", "sign", "unit", "calibration", "capacity", "max_step", "mass_reads_force")
    kept = [part for part in settings.split("&") if mark and part.partition("=")[0] not in dropped]
    return f"{body}?{'&'.join([*kept, 'gain=1', 'sign=1'])}"
