"""The lines of a check: of the disk, of the budget of E, of what moves, and what to change for less noise."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import reduce

from acquire.burst import sum_kind
from acquire.hdf5 import free_bytes
from acquire.record_mode import RecordMode
from acquire.text import Amount, Message, joined, word
from analysis.quality.steadiness import Steadiness, mains_of, strain_drifts
from live.config.cameras import other_cameras
from live.config.loading import Config
from live.config.sections import DEFAULT_BURST
from live.pipeline.measurement import AXIAL
from live.results.budget import CameraView, budget_cells, budget_rows
from live.results.figures import tensile_options
from live.setup.check.check_list import CheckFigures
from live.setup.check.noise_floor import ZoiFloor
from live.setup.check.sample import MIN_FRAMES, FrameStack
from live.setup.check.stillness import PictureStillness

SHORTEST_S = 600.0
"""Of a test whose length is not given."""
ELASTIC = 1e-3
"""End of the elastic interval where the standard takes it from the yield strength, which the test finds."""
MAX_DILATATION = 5e-5  # common drift of exx and eyy
FULL_LIGHT = 0.95  # of full scale: more light saturates
MAX_BURST = 1000


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


def motion_lines(f: CheckFigures, max_px: float) -> Iterator[CheckLine]:
    """Drift and vibration, and what exx and eyy do alike; motion above ``max_px`` is bad."""
    if f.lens:
        yield CheckLine("lens", f.lens)
    s = f.still
    if f.stack.few:
        yield from (not_measured(f, what) for what in ("drift", "vibration"))
        return
    if not math.isfinite(s.drift_px):
        yield CheckLine(
            "drift", Message("not measured"), f.zois.without_pattern < 1, "no ZOI can be followed"
        )
        return
    pulled = [one for one in (s.exx, s.eyy) if strain_drifts(one.drift, one.sigma_drift)]
    strain = max(pulled or (s.exx, s.eyy), key=lambda one: abs(one.drift))
    words = Message("keep specimen and camera still")
    if pulled:
        words = Message(
            "strain changes: stop the machine, take the load off, let the specimen rest, then check again"
        )
    yield CheckLine(
        "drift",
        Message(
            "{drift_px:.4f} px and {drift} in {seconds:.3g} s",
            s.drift_px,
            Amount("strain", strain.drift),
            s.u.seconds,
        ),
        s.drift_px <= max_px and not pulled,
        words,
    )
    yield from _common(s)
    shake = s.worse
    yield CheckLine(
        "vibration",
        Message(
            "{vibration}, {vibration2}",
            _vibration(shake, 1, "px", 4),
            _vibration(s.worse_strain, 1e6, "µm/m", 0),
        ),
        shake.vibration <= max_px,
        "a stiffer tripod, a quiet floor, no fan on the bench",
    )


def _common(s: PictureStillness) -> Iterator[CheckLine]:
    """What exx and eyy do alike: a change of the distance, a tilt."""
    steady = "clamp grips and tripod, warm up the camera, or hang plates (docs/optics.md)"
    if s.dilatation:
        words = Message(
            "exx and eyy drift alike, {dilatation}: it changes by {size:.1e} of the stand-off",
            Amount("strain", s.dilatation),
            abs(s.dilatation),
        )
        warm = "warm up the camera, clamp grips and tripod, or hang plates (docs/optics.md)"
        yield CheckLine("distance", words, abs(s.dilatation) < MAX_DILATATION, warm)
    across, down = s.keystone
    if across:
        drift = Amount("strain", across)
        words = Message("strain drifts by {across} from left to right, in x and y alike", drift)
        yield CheckLine("tilt", words, abs(across) < MAX_DILATATION, steady)
    if down:
        drift = Amount("strain", down)
        words = Message("strain drifts by {down} from top to bottom, in x and y alike", drift)
        yield CheckLine("tilt", words, abs(down) < MAX_DILATATION, steady)


def _vibration(s: Steadiness, unit: float, name: str, digits: int) -> str:
    """A vibration with its frequency, or its upper limit by the noise."""
    if not s.vibration > s.noise / 2:
        return Message("less than {noise} {name}", Message(f"{{n:.{digits}f}}", s.noise * unit), name)
    text = Message("{vibration} {name} rms", Message(f"{{n:.{digits}f}}", s.vibration * unit), name)
    if s.frequency is None:
        return text
    mains = mains_of(s, 1)
    cause = Message(", as from {mains:.0f} Hz mains", mains) if mains is not None else ""
    return Message("{text}, mainly at {frequency:.1f} Hz{cause}", text, s.frequency, cause)


def reaching(floors: Sequence[ZoiFloor], target: float) -> list[tuple[ZoiFloor, int]]:
    """For each size of ZOI the shortest burst, at the lowest order, with a noise of at most ``target``."""
    found: dict[int, tuple[ZoiFloor, int]] = {}
    for floor in floors:
        for noise in floor.noises:
            best = found.get(floor.zoi)
            if noise.known <= target and (best is None or noise.burst < best[1]):
                found[floor.zoi] = (floor, noise.burst)
    return [found[zoi] for zoi in sorted(found)]


def advice(figures: CheckFigures, target: float) -> str:
    """What to change for a strain noise of one ZOI of at most ``target`` (dimensionless)."""
    ways = list(_ways(figures, target))
    if ways:
        return reduce(lambda first, other: Message("{first}, or {other}", first, other), ways)
    if not figures.floors:
        return Message("the table of phasedic check shows what reaches it")
    return Message(
        "nothing here reaches it: more contrast, a finer pattern, a closer or quieter camera, more light"
    )


def _ways(figures: CheckFigures, target: float) -> Iterator[str]:
    now = figures.floor
    for floor, burst in reaching(figures.floors, target):
        same_zoi, same_burst = floor.zoi == figures.zoi, burst == figures.burst
        order = "" if floor.order == figures.order else Message(" of order {order}", floor.order)
        if same_zoi:
            yield Message("burst {burst}{order}", burst, order)
        elif same_burst or burst < figures.burst:
            yield Message("ZOI {zoi}{order}", floor.zoi, order)
            break
        else:
            yield Message("ZOI {zoi}{order} and burst {burst}", floor.zoi, order, burst)
    noise = None if now is None else now.of(figures.burst)
    if now is None or noise is None or not noise.known > target:
        return
    if not any(floor.zoi == figures.zoi for floor, _ in reaching(figures.floors, target)):
        yield from _longer(now, figures.burst, noise.known, target)
    yield _more_light(figures, (noise.known / target) ** 2)


def _longer(floor: ZoiFloor, burst: int, noise: float, target: float) -> Iterator[str]:
    """A burst beyond the table; the noise of the reference limits its effect."""
    one = noise**2 / (1 / floor.reference + 1 / burst)
    rest = target**2 / one - 1 / floor.reference
    if rest > 1 / MAX_BURST:
        yield Message("burst {number} with ZOI {zoi}", math.ceil(1 / rest), floor.zoi)
    elif 2 * one / target**2 < MAX_BURST:
        both = math.ceil(2 * one / target**2)
        yield Message("burst {both} and a reference of {both} with ZOI {zoi}", both, floor.zoi)


def _more_light(figures: CheckFigures, factor: float) -> str:
    """More light or contrast; with shot noise, twice the light gives 1.4 times the signal-to-noise ratio."""
    possible = FULL_LIGHT / max(figures.exposure.high, 1e-3)
    times = Message("twice") if 1.8 < factor < 2.2 else Message("{factor:.1f} times", factor)
    if factor <= possible:
        return Message("{times} the light or exposure", times)
    need = math.sqrt(factor / max(possible, 1.0))
    return Message(
        "{need:.1f} times the contrast (light helps {possible:.1f} times, then it saturates)", need, possible
    )
