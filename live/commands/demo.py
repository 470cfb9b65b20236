"""``phasedic demo``: a live run on the simulated rig, compared with its truth.

The truth of a ZOI is the affine field (least squares with the weight of the ZOI) through the displacement that the
simulator prescribes: the best that a ZOI of that size can resolve. It is computed here from the prescribed
displacement, without any of the measuring code.
"""

from __future__ import annotations

import argparse
import math
import time
from collections import deque
from contextlib import nullcontext
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from acquire.addresses import parse_address, with_setting
from acquire.clock import Clock
from acquire.errors import LOSS
from acquire.frame import Frame
from acquire.text import Amount, Message, word
from analysis import PICTURE_KINDS
from analysis.evaluate import AreaStrain
from analysis.field import Status, StrainField, Sums
from live.commands.options import add_measure, add_options, configured, number
from live.commands.run import finish, run_attended
from live.config.loading import Config
from live.config.values import AUTO
from live.pipeline.consumer import Consumer, Screen
from live.pipeline.measurement import AXIAL, Measurement
from live.results.figures import tensile_table
from live.results.folder import check_folder
from live.run.outcome import Outcome
from live.setup.compiling import compile_ahead
from live.setup.region import located
from live.ui.terminal.screen import TerminalScreen

if TYPE_CHECKING:
    from analysis import ZoiGrid
    from analysis.evaluate import TensileFigures
    from hw_mocks.specimen import VirtualSpecimen
    from live.run.live_run import LiveRun

Array = NDArray[np.float64]
WIDTH_MM, THICKNESS_MM = 20.0, 2.0
SPECIMENS = ("woven", "uniform", "hole", "halves")
RELATIVE = 0.0005  # of the strain, beside three times the predicted uncertainty
MIN_WITHIN = 0.97  # 99 % are to be expected; of 150 values, chance takes one in a few runs below that
FAR = 2.5  # half intervals of E: beyond it, chance takes one run in a million
ELASTIC_BURSTS = 56
"""Bursts that the elastic part is to have: 40 are left where a machine becomes slower by a third during the test."""
ELASTIC_SHARE, SHORTEST_S, LONGEST_S = 0.6, 17.0, 150.0
"""Share of the pull up to yield; limits of its length, s."""
RATE_BURSTS, LEAD_S, LONGEST_WAIT_S = 6, 0.5, 120.0
"""Bursts that give the rate of this machine; s from then to the pull, and from the start to it at the longest."""
SLOW_FPS, SMALL = 5.0, {"width": 320, "height": 256, "hole": 30, "cell": 48}
"""Below this rate of the whole picture, a quarter of it is taken: half of all lengths."""
SMALL_LOAD_RATE = 20.0  # 1/s, then


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``phasedic demo``."""
    words = "simulated specimen (default woven)"
    parser.add_argument("--specimen", choices=SPECIMENS, default="woven", help=words)
    words = "frame rate of the simulated camera (default: as fast as this machine renders, at most 30)"
    parser.add_argument("--fps", type=number(0.1, 1000), help=words)
    add_options(parser, "time", "seconds")
    add_measure(parser)


def command(arguments: argparse.Namespace) -> int:
    """``phasedic demo``; the code of the run, 1 if the strain differs from the truth, 5 if E was not measured."""
    screen = TerminalScreen()
    config = configured(arguments, _defaults(arguments))
    check_folder(config.output.dir)
    # All that the next commands need too: 8-bit pictures, and a batch.
    compile_ahead(PICTURE_KINDS, phase=True, screen=screen)
    config = fitting(config)
    collector, operator = MeansCollector(), Operator(config.output.seconds)
    # The whole picture is specimen: it is only looked at where gauges are to be placed.
    with located(config, screen) if config.measure.gauges == AUTO else nullcontext(config) as config:
        test = run_attended({"": config}, screen, {"": [collector, operator]}, operator.attend)
    finish(test, screen, verbose=arguments.verbose)
    outcome = test.cameras[""]
    if outcome.rig.specimen is None or not collector.measurements:
        return outcome.exit_code
    code = compare(outcome, collector, config, screen)
    return code if code == 1 else outcome.exit_code or code


def fitting(config: Config) -> Config:
    """The rig with a smaller picture and fewer forces where this machine is slow, and the rate is not given."""
    from hw_mocks.sim_camera import fps_on_this_machine

    address = config.camera.address
    parsed = parse_address(address)
    if ("fps", "auto") not in parsed.settings or fps_on_this_machine(parsed) >= SLOW_FPS:
        return config
    for key, value in SMALL.items():
        address = with_setting(address, key, value)
    load = with_setting(config.load.address, "rate", SMALL_LOAD_RATE)
    return replace(
        config, camera=replace(config.camera, address=address), load=replace(config.load, address=load)
    )


def _defaults(arguments: argparse.Namespace) -> dict[str, Any]:
    section = WIDTH_MM * THICKNESS_MM
    given = getattr(arguments, "output.seconds")
    wait, seconds = (LONGEST_WAIT_S, LONGEST_WAIT_S + SHORTEST_S) if given is None else (given / 2, given)
    fps = "auto" if arguments.fps is None else f"{arguments.fps:g}"
    return {
        "camera.address": (
            f"sim:{arguments.specimen}?bits=12&fps={fps}&buffers=64&section_mm2={section:g}"
            f"&waits=yes&hold={wait:g}&seconds={seconds:g}"
        ),
        "load.address": "sim:",
        "specimen.width_mm": WIDTH_MM,
        "specimen.thickness_mm": THICKNESS_MM,
        "metadata.specimen": f"simulated tensile specimen, {arguments.specimen}",
        "metadata.note": "simulated camera and load cell",
    }


@dataclass(frozen=True, slots=True, eq=False)
class MeasuredMeans:
    """The strains of a measurement for the comparison; ``times`` (n,) are those of its frames, s."""

    times: Array
    pattern: Sums | None
    valid: NDArray[np.bool_]
    mean: tuple[float, float, float]
    sigma: tuple[float, float, float]


def _strains(field: StrainField) -> tuple[float, float, float]:
    """exx, eyy, exy of the region; NaN where no ZOI has a value."""
    area = AreaStrain.of(field)
    if area is None:
        return math.nan, math.nan, math.nan
    return area.value("exx"), area.value("eyy"), area.value("exy")


class Operator(Consumer):
    """Lets the rig pull once there is a reference, so slowly that this machine measures enough in the elastic part.

    Parameters
    ----------
    seconds : float or None, s
        Length of the whole test where it is given: then the pull takes what is left.
    clock : callable giving monotonic seconds
    """

    name = "operator of the rig"
    blocks = False

    def __init__(self, seconds: float | None, clock: Clock = time.monotonic) -> None:
        self._seconds, self._clock = seconds, clock
        self._measured: deque[tuple[float, float]] = deque(maxlen=RATE_BURSTS)
        self._specimen: VirtualSpecimen | None = None
        self._lead_s = LEAD_S

    def attend(self, live: LiveRun) -> None:
        """Operate the rig of this run."""
        self.operate(live.rig.specimen, live.rig.camera.info.fps)

    def operate(self, specimen: VirtualSpecimen | None, fps: float | None) -> None:
        """Operate the machine of ``specimen``; pictures are made up to one period of ``fps`` (1/s) beforehand."""
        self._specimen, self._lead_s = specimen, LEAD_S + 1 / (fps or 1.0)

    def measurement(self, measurement: Measurement) -> None:
        """Start the pull where the rate of the bursts is known: the lower of that of their times and of the results."""
        pull = None if self._specimen is None else self._specimen.programme.pull
        if self._specimen is None or pull is None or pull.told is not None:
            return
        now = self._clock()
        self._measured.append((measurement.t, now))
        begins_s = self._specimen.elapsed(now) + self._lead_s
        if self._seconds is not None:
            pull.start(begins_s, max(self._seconds - begins_s - self._specimen.programme.end_s, 0.1))
        elif len(self._measured) == RATE_BURSTS:
            period_s = max(np.subtract(self._measured[-1], self._measured[0])) / (RATE_BURSTS - 1)
            wanted_s = ELASTIC_BURSTS * period_s / ELASTIC_SHARE
            pull.start(begins_s, float(np.clip(wanted_s, SHORTEST_S, LONGEST_S)))


class MeansCollector(Consumer):
    """Collects the means of all measurements, and the times of all frames by their numbers."""

    name = "comparison with the truth"
    blocks = False

    def __init__(self) -> None:
        self.measurements: list[MeasuredMeans] = []
        self._times: dict[int, float] = {}

    def frame(self, frame: Frame) -> None:
        """Keep its time: those of a busy machine are not evenly spaced."""
        self._times[frame.index] = frame.t

    def measurement(self, measurement: Measurement) -> None:
        """Keep the means of the small strains, their sigmas and their ZOIs; the truth is a small strain."""
        m, i = measurement, measurement.time_step
        even = m.t + np.linspace(-0.5, 0.5, m.burst.n) * m.burst.duration
        times = np.array([self._times.get(m.burst.first_index + k, t) for k, t in enumerate(even)])
        self.measurements.append(
            MeasuredMeans(
                times,
                m.field.sums,
                m.field.ok,
                _strains(replace(m.field, measure="small")),
                (i.sigma_exx, i.sigma_eyy, i.sigma_exy),
            )
        )


class ZoiTruth:
    """The true gradients that ZOIs of a grid can see.

    Parameters
    ----------
    specimen : VirtualSpecimen
    grid : ZoiGrid
    corner : (x, y), px
        Where the grid's picture begins in the camera's, where it is only a part of it.
    """

    def __init__(self, specimen: VirtualSpecimen, grid: ZoiGrid, corner: tuple[int, int] = (0, 0)) -> None:
        self._specimen, self._grid = specimen, grid
        half = (grid.size - 1) / 2
        place = np.arange(grid.size) - half
        weight = np.exp(-(place**2) / (2 * (grid.size / 6) ** 2))
        weight /= weight.sum()
        slope = weight * place / (weight @ place**2)
        self._x0, self._y0 = grid.x[0] - half, grid.y[0] - half
        self._down = [_windows(grid.y, self._y0 + half, one) for one in (weight, slope)]
        self._across = [_windows(grid.x, self._x0 + half, one).T for one in (weight, slope)]
        columns = np.arange(round(grid.x[-1] + half) + 1 - round(self._x0)) + round(self._x0)
        rows = np.arange(round(grid.y[-1] + half) + 1 - round(self._y0)) + round(self._y0)
        self._x, self._y = np.meshgrid(columns + float(corner[0]), rows + float(corner[1]))

    def strains(self, t: float) -> tuple[Array, Array, Array]:
        """(exx, eyy, exy) of each ZOI, (R, C), ``t`` seconds since the start of the simulated test."""
        _, du_dx, du_dy, _, dv_dx, dv_dy = self._parameters(t)
        return du_dx, dv_dy, (du_dy + dv_dx) / 2

    def region(
        self, t: float, valid: NDArray[np.bool_], pattern: Sums | None = None
    ) -> tuple[float, float, float]:
        """(exx, eyy, exy) that the ``valid`` ZOIs (R, C) give together, as the region of a measurement.

        They weigh as in the measurement, by their ``pattern``: in a field that is not uniform the strain depends on it.
        """
        names = ("u", "du_dx", "du_dy", "v", "dv_dx", "dv_dy")
        status = np.where(valid, Status.OK, Status.LOST)
        values = dict(zip(names, self._parameters(t), strict=True))
        return _strains(replace(StrainField.from_values(self._grid, values, status=status), sums=pattern))

    def _parameters(self, t: float) -> tuple[Array, Array, Array, Array, Array, Array]:
        u, v = self._specimen.displacement(self._x, self._y, t)
        # Weighted least squares of a plane: the weight is even, so the slopes separate.
        (mean_y, slope_y), (mean_x, slope_x) = self._down, self._across
        along_u, along_v = _product(mean_y, u), _product(mean_y, v)
        return (
            _product(along_u, mean_x), _product(along_u, slope_x), _product(_product(slope_y, u), mean_x),
            _product(along_v, mean_x), _product(along_v, slope_x), _product(_product(slope_y, v), mean_x),
        )  # fmt: skip


def _product(a: Array, b: Array) -> Array:
    """Product of two matrices, by this thread alone: threads of BLAS wait for each other on a busy machine."""
    return np.asarray(np.einsum("ij,jk->ik", a, b))


def _windows(centres: Array, first: float, weights: Array) -> Array:
    """(N, P): a row for each of N ZOIs that begins where it begins, and has the weights of its P pixels."""
    begins = np.rint(centres - first).astype(int)
    rows = np.zeros((len(begins), begins[-1] + len(weights)))
    for row, begin in zip(rows, begins, strict=True):
        row[begin : begin + len(weights)] = weights
    return rows


def middle_of(specimen: VirtualSpecimen, times: Array) -> float:
    """When the strain was that of the mean of the frames: not in the middle where the ramp begins in a burst."""
    strain = specimen.axial_strain(times)
    if not strain[-1] > strain[0]:
        return float(times.mean())
    return float(np.interp(strain.mean(), strain, times))


def compare(outcome: Outcome, collector: MeansCollector, config: Config, screen: Screen) -> int:
    """Print what was measured against the truth; 1 where the elastic part differs, 5 where E was not measured."""
    specimen = outcome.rig.specimen
    assert specimen is not None
    crop = config.camera.crop or (0, 0, 0, 0)
    truth = ZoiTruth(specimen, outcome.grid, (crop[0], crop[1]))
    ratios, errors, last = [], [], None
    for m in collector.measurements:
        times = np.array([specimen.elapsed(t) for t in m.times])
        elapsed = middle_of(specimen, times)
        true = np.array(truth.region(elapsed, m.valid, m.pattern))
        error, sigma = np.array(m.mean) - true, np.array(m.sigma)
        if times[-1] <= specimen.yield_s:
            ratios.append([np.abs(error) / (RELATIVE * np.abs(true) + k * sigma) for k in (3, 5)])
            errors.append(error)
            last = (elapsed, m)
    screen.print("")
    screen.print(Message("against the simulated truth (elastic part; exx, eyy, exy):"))
    # Without a measured instant nothing is wrong: the machine was too slow, and E is not known.
    agreed = _print_strain(np.array(ratios), np.array(errors), screen) or not ratios
    _print_force(outcome, specimen, screen)
    figures = outcome.test.figures
    there = specimen.E, specimen.nu
    # In an uneven field (the hole) the strain of the region is not that of a specimen without it.
    if figures.E.known and last is not None and AXIAL not in config.gauges:
        exx, eyy, _ = truth.region(last[0], last[1].valid, last[1].pattern)
        there = float(specimen.stress(last[0])) / eyy, -exx / eyy
    agreed &= _print_modulus(figures, specimen, there, screen)
    if agreed and not figures.E.known and not outcome.exit_code:
        screen.print(
            Message(
                "exit code {code}: E was not measured ({why}); end other programs, or give a smaller --burst",
                *(LOSS, figures.E.why),
            )
        )
        return LOSS
    return 0 if agreed else 1


def _print_modulus(
    figures: TensileFigures,
    specimen: VirtualSpecimen,
    there: tuple[float, float],
    screen: Screen,
) -> bool:
    """E and nu against the truth ``there``; False where E is far off."""
    rows, off = tensile_table(figures, stresses=True), 0.0
    true = Message("true {value}", Amount("stress", specimen.E, digits=2))
    true_nu = Message("true {value}", Amount("", specimen.nu, digits=2))
    if figures.E.known:
        off = abs(rows["E"].figure.value - there[0] / 1e9) / rows["E"].figure.half
        held = word("within its interval") if off <= 1 else Message("off by {n:.1f} times its interval", off)
        here, here_nu = Amount.rough("stress", there[0], 5), Amount.rough("", there[1], 4)
        true = Message(
            "by {strain}: {held}, true {here} there ({true} of the material)",
            *(figures.elastic_strain, held, here, true),
        )
        true_nu = Message("true {here} there ({true})", here_nu, true_nu)
    screen.print(Message("  E  {E}, {true}", rows["E"].text, true))
    screen.print(Message("  nu {nu}, {true}", rows["nu"].text, true_nu))
    return off <= FAR


def _print_strain(ratios: Array, errors: Array, screen: Screen) -> bool:
    """``ratios`` (N, 2, 3): the error of each of the three in units of 0.05 % + 3 sigma, and of 0.05 % + 5 sigma."""
    if not ratios.size:
        screen.print(Message("  no instant of the elastic part was measured"))
        return False
    within, rms = ratios[:, 0] <= 1, np.sqrt(np.mean(errors**2, axis=0)) * 1e6
    beyond = int(np.sum(~(ratios[:, 1] <= 1)))
    screen.print(
        Message(
            "  strain of the region: error {x:.2f}, {y:.2f}, {xy:.2f} µm/m rms in {n} instants",
            *(*rms, len(ratios)),
        )
    )
    screen.print(
        Message(
            "  {share:.1%} of these {n} values within {relative:.2%} of the strain + 3 sigma, {beyond} beyond 5 sigma",
            *(within.mean(), within.size, RELATIVE, beyond),
        )
    )
    return float(within.mean()) >= MIN_WITHIN and beyond == 0


def _print_force(outcome: Outcome, specimen: VirtualSpecimen, screen: Screen) -> None:
    t, force = outcome.run_state.loads.arrays()
    true = specimen.force(np.array([specimen.elapsed(time) for time in t]))
    error = (force - true)[np.isfinite(force)]
    if error.size:
        mean, scatter = (Amount.rough("force", float(one)) for one in (error.mean(), error.std()))
        screen.print(
            Message("  force: mean error {mean}, scatter {scatter} in {n} samples", mean, scatter, error.size)
        )
