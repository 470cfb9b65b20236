"""A line of the check, and those of the disk and of the budget of E.

How long the disk lasts for the recording of a test, from the pictures of a check.

The budget of E before a test: what is given, the noise of the pictures, and what is not stated.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from acquire.burst import sum_kind
from acquire.hdf5 import free_bytes
from acquire.record_mode import RecordMode
from acquire.text import Message
from acquire.text.message import joined, word
from live.config.cameras import other_cameras
from live.config.loading import Config
from live.config.sections import DEFAULT_BURST
from live.pipeline.measurement import AXIAL
from live.results.budget import CameraView, budget_cells, budget_rows
from live.results.figures import tensile_options
from live.setup.check.check_list import CheckFigures
from live.setup.check.sample import MIN_FRAMES, FrameStack


@dataclass(frozen=True, slots=True)
class CheckLine:
    """One figure of the check, whether it is good enough, and what to do if it is not.

    A figure that the pictures do not give (not ``measured``) is neither good nor bad. ``what`` and ``advice`` are words
    of the program, ``value`` a message or what was read.
    """

    what: str
    value: str
    good: bool = True
    advice: str = ""
    measured: bool = True

    def text(self) -> str:
        """The line as printed."""
        mark = ("ok  " if self.measured else "?   ") if self.good else "LOOK"
        line = Message("{mark}  {what:<22} {value}", mark, word(self.what), self.value)
        return line if self.good else joined("\n      -> ", (line, word(self.advice)))


def not_measured(f: CheckFigures, what: str) -> CheckLine:
    return CheckLine(
        what,
        Message(
            "not measured from {count_text}: it takes {MIN_FRAMES} of the still specimen",
            f.stack.count_text,
            MIN_FRAMES,
        ),
        measured=False,
    )


SHORTEST_S = 600.0
"""Of a test whose length is not given."""


def write_rate(stack: FrameStack, config: Config) -> float:
    """What the recording of these pictures writes, bytes/s: at the rate at which they came, in the recorder's form.

    The parts of further cameras are taken to be the same. 0 where nothing is recorded, or the pictures are not live.
    """
    camera, m = stack.camera, config.measure
    if not (config.record.enabled and camera.live):
        return 0.0
    span_s = float(stack.times[-1] - stack.times[0])
    fps = (len(stack) - 1) / span_s if span_s > 0 else camera.fps or 0.0
    mode, burst = RecordMode.parse(config.record.mode), m.burst or DEFAULT_BURST
    size = stack.frames.itemsize / mode.every
    if mode.kind == "bursts":
        size = (
            sum_kind(camera.bits, burst).itemsize + 1 / 8
        ) / burst  # the sum, and a bit for clipped pixels
    return camera.width * camera.height * size * fps * (1 + len(other_cameras(config)))


def disk_lines(rate: float, config: Config) -> list[CheckLine]:
    """The line of the disk for a recording of ``rate`` (``write_rate``); none where nothing is recorded."""
    if not rate:
        return []
    wanted_s, folder = config.output.seconds or SHORTEST_S, config.output.dir or "runs"
    try:
        free = free_bytes(folder)
    except OSError as error:
        words = Message("connect the disk, or choose a folder on another")
        return [
            CheckLine(
                "disk",
                Message("{folder}: cannot be asked ({strerror})", folder, error),
                False,
                words,
            )
        ]
    minutes = math.floor(10 * free / rate / 60) / 10  # not more than there is
    return [
        CheckLine(
            "disk",
            Message(
                "room for {minutes:.4g} min at this rate ({rate:.3g} MB/s, {free:.3g} GB free)",
                minutes,
                rate / 1e6,
                free / 1000000000.0,
            ),
            free / rate >= wanted_s,
            Message(
                "too little for a test of {wanted_s:.3g} min: free some space, choose a folder on another disk, or "
                "record bursts only",
                wanted_s / 60,
            ),
        )
    ]


ELASTIC = 1e-3
"""End of the elastic interval where the standard takes it from the yield strength, which the test finds."""


def budget_lines(figures: CheckFigures, config: Config) -> list[str]:
    """The table as text; nothing where no noise is known. Scatter is of one value: a line through many has less."""
    noise = _noise(figures)
    if math.isnan(noise):
        return []
    options = tensile_options(config.specimen)
    interval = options.standard.interval
    strain = interval.high if interval.by == "strain" else ELASTIC
    shares = {"scatter": noise / strain, **options.limits.shares(strain)}
    view = CameraView.of(config.camera, config.scale, plates=bool(config.plate))
    expected = config.specimen.modulus_GPa or math.nan
    rows = budget_rows(shares, strain, expected, view, stresses=config.specimen.area_m2 is not None)
    head = Message(
        "budget of E, standard uncertainties, at a strain of {strain:.2%} (scatter: of one value)", strain
    )
    return [head, *(_line(*cells) for cells in budget_cells(rows, "GPa", 1.0))]


def _line(cause: str, *cells: str) -> str:
    if not cells[1]:
        return Message("  {cause:<22} {words}", cause, cells[0])
    return joined(" ", (Message("  {cause:<22}", cause), *(Message("{cell:>8}", cell) for cell in cells)))


def _noise(figures: CheckFigures) -> float:
    """Noise of the gauge along the load, else of the mean of the region."""
    known = {gauge.name: gauge.sigma for gauge in figures.gauges}
    return known.get(AXIAL, known.get("", math.nan))
