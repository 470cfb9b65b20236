"""What can be said on the command line, and what it sets.

Only argparse is imported here, so that ``phasedic --help`` answers at once. ``start`` names the
function of a command, which is imported when the command runs.
"""

from __future__ import annotations

import argparse
from typing import Any

EXIT_CODES = """exit codes:
  0 well   1 a defect of phasedic   2 usage or configuration   3 device   4 file or data
  5 finished with loss   6 not ready (checks)   130 interrupted, everything closed cleanly
"""


def _roi(text: str) -> list[int]:
    try:
        values = [int(part) for part in text.split(",")]
    except ValueError:
        values = []
    if len(values) != 4:
        raise argparse.ArgumentTypeError("give four whole numbers x,y,width,height")
    return values


def _add_measure(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("measurement")
    group.add_argument("--config", metavar="FILE", help="TOML file; what is given here overrides it")
    group.add_argument(
        "--roi", type=_roi, metavar="X,Y,W,H", help="measured region, px (default: all but a rim)"
    )
    group.add_argument("--mask", metavar="FILE", help="image; ZOIs where it is black are not measured")
    group.add_argument("--zoi", type=int, metavar="PX", help="side of a ZOI (default 64)")
    group.add_argument("--step", type=int, metavar="PX", help="distance of ZOIs (default 16)")
    group.add_argument("--burst", type=int, metavar="N", help="frames averaged for a measurement (default 4)")
    group.add_argument(
        "--reference-burst", type=int, metavar="N", help="frames averaged for the reference (default 32)"
    )
    group.add_argument("--window", help="weight of a ZOI: gaussian, uniform, tukey, bi-triangular")
    group.add_argument("--estimator", help="spectral (default) or phase")
    group.add_argument("--order", type=int, help="shape of a ZOI: 1 affine (default), 2 quadratic")
    group.add_argument(
        "--bending",
        type=float,
        metavar="PX",
        help="refuse ZOIs with jumps or bends beyond (default 0.05; inf: none)",
    )
    group.add_argument(
        "--noise", type=float, metavar="GL", help="noise of one frame, where no burst tells it"
    )
    _add_output(parser)


def _add_output(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("output")
    group.add_argument(
        "--out", metavar="DIR", help="folder of the files (default: new, in runs/, by UTC time)"
    )
    group.add_argument("--no-view", action="store_true", help="serve no view")
    group.add_argument("--no-rrd", action="store_true", help="write no view.rrd")
    group.add_argument("--axis", choices=("x", "y"), help="direction of the load in the image (default y)")
    group.add_argument("--section", metavar="W,T", help="width,thickness of the section in mm, for stresses")
    group.add_argument("--meta", action="append", default=[], metavar="KEY=TEXT", help="stored in every file")
    group.add_argument("--verbose", "-v", action="store_true", help="tell more")


def make_parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="phasedic",
        description="Live strain measurement by phase-DIC: frames, load, strain maps while the specimen is pulled.",
        epilog=EXIT_CODES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=_version())
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    _add_run(commands)
    _add_demo(commands)
    _add_replay(commands)
    _add_map(commands)
    _add_characterise(commands)
    _add_inspect(commands)
    _add_check(commands)
    average = commands.add_parser("average", help="average frames into a dark or flat frame")
    average.add_argument("--camera", required=True, metavar="ADDRESS")
    average.add_argument("--frames", type=int, default=64, metavar="N", help="default 64")
    average.add_argument("--crop", type=_roi, metavar="X,Y,W,H", help="use this part of the picture only")
    average.add_argument("--out", required=True, metavar="FILE", help="a TIFF that does not exist yet")
    average.set_defaults(start="live.commands.devices:average")
    _add_load_commands(commands)
    devices = commands.add_parser("devices", help="list cameras with their formats, and serial ports")
    devices.set_defaults(start="live.commands.devices:devices")
    return parser


def _add_run(commands: Any) -> None:
    run = commands.add_parser(
        "run",
        help="measure live, recording everything",
        epilog=EXIT_CODES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    run.add_argument(
        "--camera", metavar="ADDRESS", help="/dev/video0?format=Y12&fps=30, opencv:0, sim:woven ..."
    )
    run.add_argument(
        "--load", metavar="ADDRESS", help="/dev/ttyUSB0?protocol=ascii&baud=115200&unit=N, none:"
    )
    run.add_argument("--no-record", action="store_true", help="do not record the session")
    run.add_argument("--record", metavar="MODE", help="all (default), bursts, or every=K")
    run.add_argument("--dark", metavar="FILE", help="dark frame (phasedic average) taken off every burst")
    run.add_argument("--flat", metavar="FILE", help="flat frame (phasedic average) that divides every burst")
    run.add_argument("--crop", type=_roi, metavar="X,Y,W,H", help="use this part of the picture only")
    run.add_argument("--seconds", type=float, metavar="S", help="end after this time")
    _add_measure(run)
    run.set_defaults(start="live.commands.run:run")


def _add_demo(commands: Any) -> None:
    demo = commands.add_parser("demo", help="the same on a simulated tensile test, compared with its truth")
    demo.add_argument("--specimen", default="woven", help="woven (default), uniform or hole")
    demo.add_argument(
        "--fps",
        type=float,
        help="frame rate of the simulated camera (default: what this machine renders, at most 30)",
    )
    demo.add_argument("--seconds", type=float, metavar="S", help="end after this time")
    _add_measure(demo)
    demo.set_defaults(start="live.commands.demo:demo")


def _add_replay(commands: Any) -> None:
    replay = commands.add_parser(
        "replay",
        help="measure a recorded session, or any folder of pictures",
        epilog=EXIT_CODES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    replay.add_argument("source", help="session.h5, 'files:shots/*.tif' or 'video:file.mp4'")
    replay.add_argument("--as-measured", action="store_true", help="the bursts of the live run, bit-equal")
    replay.add_argument("--from", dest="start_s", type=float, metavar="S", help="begin here, seconds")
    replay.add_argument("--to", dest="end_s", type=float, metavar="S", help="end here, seconds")
    replay.add_argument("--reference", metavar="FILE", help="reference picture (default: the first)")
    _add_measure(replay)
    replay.set_defaults(start="live.commands.replay:replay_command")


def _add_map(commands: Any) -> None:
    one = commands.add_parser("map", help="draw a map of the results over a picture, as a PNG")
    one.add_argument("results", help="strain.h5")
    one.add_argument("png", help="the picture to write")
    one.add_argument("--field", default="eyy", help="u, v, exx, eyy, exy, sigma_eyy, residual, status ...")
    one.add_argument("--row", type=int, default=-1, help="which measured instant (default: the last)")
    one.add_argument("--over", metavar="FILE", help="image to draw over")
    one.add_argument("--limit", type=float, help="colour range -LIMIT to LIMIT (default: automatic)")
    one.add_argument("--title")
    one.add_argument(
        "--median", type=int, default=1, metavar="N", help="median filter of N x N ZOIs, for show"
    )
    one.add_argument("--low-pass", type=float, default=0.0, metavar="PX", help="Gaussian filter, for show")
    one.add_argument(
        "--deconvolve",
        type=int,
        default=0,
        metavar="STEPS",
        help="take the blur of the ZOI off, for show (order 1): 3 or 7 steps; the title says what they do",
    )
    one.set_defaults(start="live.maps.map:command")


def _add_characterise(commands: Any) -> None:
    from live.characterise.command import add_arguments

    characterise = commands.add_parser(
        "characterise",
        help="how well this measures: the paper reproduced, peers, or your own pattern",
        epilog=EXIT_CODES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add_arguments(characterise)
    characterise.set_defaults(start="live.characterise.command:command")


def _add_inspect(commands: Any) -> None:
    from live.commands.inspect import add_arguments

    inspect = commands.add_parser("inspect", help="one ZOI of a session: its spectrum and its phases")
    add_arguments(inspect)
    inspect.set_defaults(start="live.commands.inspect:command")


def _add_check(commands: Any) -> None:
    check = commands.add_parser(
        "check", help="is the picture good enough? measured before the test; go or no-go"
    )
    check.add_argument("--camera", metavar="ADDRESS")
    check.add_argument("--crop", type=_roi, metavar="X,Y,W,H", help="use this part of the picture only")
    check.add_argument(
        "--target", type=float, metavar="UM_M", help="strain noise of one ZOI that is needed, um/m"
    )
    _add_measure(check)
    check.set_defaults(start="live.commands.check:check")


def _add_load_commands(commands: Any) -> None:
    check = commands.add_parser(
        "load-check", help="listen to a load cell: rate, range, noise, flags; ready or not"
    )
    check.add_argument("--load", required=True, metavar="ADDRESS")
    check.add_argument("--seconds", type=float, default=10.0, metavar="S", help="default 10")
    check.set_defaults(start="live.commands.load:load_check")
    identify = commands.add_parser("identify", help="find out what talks on a serial port; only listens")
    identify.add_argument("device", help="/dev/ttyUSB0")
    identify.add_argument(
        "--ask", action="store_true", help="also send queries (an unknown machine may move)"
    )
    identify.set_defaults(start="live.commands.load:identify")
    calibrate = commands.add_parser("load-calibrate", help="calibrate a load cell: tare, known load, accept")
    calibrate.add_argument("--load", required=True, metavar="ADDRESS")
    calibrate.add_argument("--mass", type=float, metavar="KG", help="the known load as a mass")
    calibrate.add_argument("--force", type=float, metavar="N", help="the known load as a force")
    calibrate.add_argument("--out", required=True, metavar="FILE", help="where the calibration is kept")
    calibrate.add_argument(
        "--seconds", type=float, default=3.0, metavar="S", help="of each reading (default 3)"
    )
    calibrate.set_defaults(start="live.commands.load:load_calibrate")
    recover = commands.add_parser("recover", help="copy what is readable of a damaged or unfinished session")
    recover.add_argument("session")
    recover.add_argument("--out", metavar="FILE", help="the copy (default: beside it)")
    recover.set_defaults(start="live.commands.recover:recover")


def _version() -> str:
    from live import VERSION

    return f"phasedic {VERSION}"
