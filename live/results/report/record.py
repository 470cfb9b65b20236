"""Sections of the report from the record of a run: gauges, times, frame counts, events, versions, files, good practice.

The reporting table of the Good Practices Guide for DIC is filled in from what was recorded: International Digital Image
Correlation Society, A Good Practices Guide for Digital Image Correlation (2018), section on reporting requirements,
doi:10.32720/idics/gpg.ed1. What was not recorded is marked as open; ``--meta KEY=TEXT`` at the run fills it in.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from acquire.events import EventKind, named
from acquire.frame import CameraInfo
from acquire.text import Amount, Message, word
from acquire.text import joined as texts
from analysis.evaluate import CONFIDENCE, NoiseFloor
from analysis.picture.pattern import describe_pattern
from analysis.quality.pattern import FWHM_OF_RADIUS, SPECKLE_RADIUS_PX
from live.pipeline.consumer import Screen
from live.pipeline.event_log import Repeats, counted_text
from live.results.figures import NOT_KNOWN, figure_text
from live.results.finished.figures_file import stored_remarks
from live.results.finished.finished_test import FinishedTest
from live.results.folder import versions
from live.results.maps.colours import unit_for
from live.results.quantities import MEANS, quantity_of
from live.results.report.page import Html, element, facts, joined, paragraph, table
from live.results.run_folder import RunFolder
from live.words.language import told

_MAX_EVENTS = 3000
_KINDS = (".h5", ".csv", ".json", ".png", ".tif")
FIGURES = (
    (
        "E",
        "Pa",
        "slope of stress over axial strain by least squares, over the strains under Figures of the test",
    ),
    ("EA", "N", "the same slope of force, where the section is not known"),
    ("nu", "1", "minus the slope of transverse over axial strain in the same part"),
    ("Rp0.1, Rp0.2, Rp1", "Pa", "stress where the curve crosses the elastic line, moved by this strain"),
    ("ReH, ReL", "Pa", "upper and lower yield strength, where there is a yield point"),
    ("Rm", "Pa", "highest stress: force over the undeformed section"),
    ("Agt, Ag", "1", "extension at Rm, total and plastic"),
    ("At, A", "1", "extension at the break, total and plastic"),
    ("r", "1", "true plastic strain of the width over that of the thickness, ISO 10113"),
    ("n", "1", "slope of the logarithm of true stress over that of true plastic strain, ISO 10275"),
)

_MICRO = 1e6


def gauges(run: RunFolder) -> Html:
    """The virtual gauges: definition, largest and last strain, and how often each was lost."""
    rows = []
    for name, gauge in run.gauges.items():
        e = unit_for(_largest(gauge.value))
        known = np.isfinite(gauge.value)
        last = Amount("strain", gauge.value[-1], gauge.sigma[-1], unit=e.name) if known[-1] else NOT_KNOWN
        words = "; ".join(f"{key} {_plain(value)}" for key, value in gauge.described.items())
        most = Amount("strain", float(f"{_largest(gauge.value):.4g}"), digits=2, unit=e.name)
        lost = Amount("count", int(np.count_nonzero(~known)))
        rows.append((name, words or Message("not recorded"), most if known.any() else NOT_KNOWN, last, lost))
    heads = (
        Message("gauge"), Message("definition, px"), Message("largest"), Message("last ± sigma"),
        Message("instants lost"),
    )  # fmt: skip
    return table(heads, rows, (2, 3, 4)) if rows else Html("")


def _largest(values: NDArray[np.float64]) -> float:
    known = values[np.isfinite(values)]
    return float(np.abs(known).max()) if known.size else 0.0


def _plain(value: object) -> str:
    if isinstance(value, list | tuple):
        return ", ".join(map(_plain, value))
    return f"{value:g}" if isinstance(value, float) else str(value)


def times(run: RunFolder, test: FinishedTest) -> Html:
    """The lag of the load behind the frames, and the latency of the results."""
    lag = test.lag
    words = Message("not known: {why}", lag.why)
    if lag.known:
        words = Message(
            "{lag} ({CONFIDENCE:.0%} interval; positive: the load is late)",
            figure_text(lag, 1e-3, "ms"),
            CONFIDENCE,
        )
    late = np.asarray(run.strain.values.get("latency_s", ()), np.float64) * 1e3
    late = late[np.isfinite(late)]
    corrected = Message("{lag:g} s", test.corrected_s) if test.corrected_s else Message("none")
    found: dict[str, object] = {
        Message("lag of the load behind the frames"): words,
        Message("lag corrected in the force"): corrected,
    }
    if late.size:
        p50, p95 = np.percentile(late, (50, 95))
        late_text = Message("p50 {p50:.0f} ms, p95 {p95:.0f} ms", p50, p95)
        found[Message("from the last frame of a burst to its result")] = late_text
    return facts(found)


def frame_counts(run: RunFolder) -> Html:
    """The frame counts of the recording."""
    found = run.frame_counts
    if not found:
        return paragraph(Message("No frame counts were recorded."), "dim")
    counts = {name: Amount("count", one) if isinstance(one, int) else one for name, one in found.items()}
    return facts({word(name): word(one) if isinstance(one, str) else one for name, one in counts.items()})


def events(run: RunFolder) -> Html:
    """The events, at most the first 3000; repeated ones in one line, with the time of the last."""
    repeats = Repeats()
    for event in run.events:
        repeats.add(event)
    found = list(repeats)
    rows = [
        (
            Message("{t:.3f}", event.t - run.start_monotonic),
            element("span", word(event.level), class_=event.level),
            word(event.kind.value),
            named(event.source),
            counted_text(event.text, count),
        )
        for event, count in found[:_MAX_EVENTS]
    ]
    if not rows:
        return paragraph(Message("No events were recorded."), "dim")
    left = len(found) - len(rows)
    more = paragraph(Message("{left} more events are in session.h5.", left), "warning") if left else Html("")
    heads = Message("time, s"), Message("level"), Message("kind"), Message("source"), Message("message")
    return joined([table(heads, rows, (0,)), more])


def remarks(run: RunFolder) -> Html:
    """What the summary of a replay said beside its figures, and what of the run cannot be read."""
    told_then = [paragraph(one) for one in stored_remarks(run.path)]
    return joined([*told_then, *(paragraph(note, "warning") for note in run.notes)])


def definitions(run: RunFolder) -> Html:
    """The definition of every number."""
    names = ["x", "y", *run.strain.names, *(MEANS.get(name, name) for name in run.strain.values)]
    known = {q.name: q for q in map(quantity_of, names)}
    rows = [*((q.name, q.unit or "1", q.words) for q in known.values()), *FIGURES]
    words = Message(
        "x right, y down, from the centre of the first pixel; all maps lie on the reference picture. "
    )
    words += Message(
        "Strain measure: {name}. Strains are dimensionless in the files.", run.strain.strain_measure
    )
    told_rows = [(name, unit, word(what)) for name, unit, what in rows]
    return joined([paragraph(words), table(("", Message("unit"), Message("definition")), told_rows)])


def version_table(run: RunFolder) -> Html:
    """Versions that measured, and versions that made the report."""
    then = {str(key): str(value) for key, value in run.strain.versions.items()}
    now = versions()
    rows = [(name, then.get(name, ""), now.get(name, "")) for name in {**then, **now}]
    return table(("", Message("measured with"), Message("report made with")), rows)


def hashes(run: RunFolder, screen: Screen) -> Html:
    """The files of the run and the replayed recording, with their size and hash."""
    files = {path for path in run.path.iterdir() if path.suffix in _KINDS and path.is_file()}
    session = run.session_path
    beside = [session] if session is not None and session.parent.resolve() != run.path.resolve() else []
    rows = []
    for path in [*sorted(files), *beside]:
        screen.status(Message("reading {name} for its hash", path.name))
        size = Amount("count", path.stat().st_size)
        rows.append((path.name, size, element("span", _sha256(path), class_="code")))
    return table((Message("file"), Message("bytes"), "SHA-256"), rows, (1,))


def _sha256(path: Path) -> str:
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        return told(Message("cannot be read: {why}", error))


@dataclass(frozen=True, slots=True, eq=False)
class PracticeValues:
    """The data for the table.

    Attributes
    ----------
    run : RunFolder
    camera : CameraInfo or None
    reference : (H, W) array or None
        A picture of the pattern.
    noise : mapping of str to NoiseFloor
        Of the still phase by map; empty where there is none.
    mm_per_px : float or None
    """

    run: RunFolder
    camera: CameraInfo | None
    reference: NDArray[np.generic] | None
    noise: Mapping[str, NoiseFloor]
    mm_per_px: float | None


def reporting_table(known: PracticeValues) -> Html:
    """Both halves of the table: hardware and analysis."""
    rows = [*_hardware(known), *_analysis(known)]
    shown = [(word(item), value if value else _open(key)) for item, key, value in rows]
    return table(("", Message("this test")), shown)


def _open(key: str) -> Html:
    hint = f" (phasedic run --meta {key}=...)" if key else ""
    return element("span", Message("not recorded") + hint, class_="open")


def _hardware(known: PracticeValues) -> list[tuple[str, str, str]]:
    meta, camera, scale = _metadata(known.run), known.camera, known.mm_per_px
    size = Message("{w} x {h} px, {bits} bits", camera.width, camera.height, camera.bits) if camera else ""
    view = f"{camera.width * scale:.4g} x {camera.height * scale:.4g} mm" if camera and scale else ""
    rate = Message("{fps:g} frames/s", camera.fps) if camera and camera.fps else ""
    return [
        ("Camera", "camera", camera.name if camera else meta("camera")),
        ("Image resolution", "", size),
        ("Lens", "lens", meta("lens")),
        ("Aperture", "aperture", meta("aperture")),
        ("Field of view", "field_of_view", view or meta("field_of_view")),
        ("Image scale", "scale", f"{scale:g} mm/px" if scale else meta("scale")),
        ("Stand-off distance", "standoff", meta("standoff")),
        ("Stereo angle", "", Message("one camera, in-plane measurement")),
        ("Image acquisition rate", "", rate),
        ("Exposure time", "exposure", _exposure(camera) or meta("exposure")),
        ("Lighting", "lighting", meta("lighting")),
        ("Patterning technique", "pattern", meta("pattern")),
        ("Pattern feature size", "", _feature(known)),
    ]


def _metadata(run: RunFolder) -> Callable[[str], str]:
    """The metadata of the operator by key; "" where there is none."""
    lower = {str(k).lower().replace("-", "_"): str(v) for k, v in run.strain.metadata.items()}
    return lambda key: lower.get(key, "")


def _exposure(camera: CameraInfo | None) -> str:
    return f"{camera.exposure_s * 1e3:.4g} ms" if camera and camera.exposure_s else ""


def _feature(known: PracticeValues) -> str:
    if known.reference is None:
        return ""
    grid = known.run.strain.grid
    roi = grid.roi
    part = np.asarray(known.reference)[roi.y : roi.y + roi.height, roi.x : roi.x + roi.width]
    try:
        width = describe_pattern(part).autocorrelation_fwhm
    except ValueError:
        return ""
    if not math.isfinite(width):
        return ""
    scale = f" ({width * known.mm_per_px:.3g} mm)" if known.mm_per_px else ""
    radius, (low, high) = width / FWHM_OF_RADIUS, SPECKLE_RADIUS_PX
    judged = Message(" (LOOK: wanted are {low:g} to {high:g} px)", low, high) * (not low <= radius <= high)
    return Message(
        "{width:.1f} px{scale}, full width at half height of the autocorrelation; radius {radius:.2f} px{judged}",
        width, scale, radius, judged,
    )  # fmt: skip


def _analysis(known: PracticeValues) -> list[tuple[str, str, str]]:
    run, measure = known.run, known.run.section("measure")
    grid, camera = run.strain.grid, run.section("camera")
    order = (
        Message("quadratic (12 parameters)")
        if measure.get("order") == 2
        else Message("affine (6 parameters)")
    )
    fields = [Message("{name} frame", name) for name in ("dark", "flat") if camera.get(name)]
    wiener = Message("Wiener filter of the reference by its own spectrum")
    window = str(measure.get("window", "gaussian"))
    weight = Message("{size} px, {window} weight", grid.size, window) + _gaussian(window, grid.size)
    return [
        ("DIC software", "", f"phasedic {run.strain.versions.get('phasedic', '')}, phase-DIC"),
        ("Image filtering", "", texts("; ", (wiener, *fields))),
        ("Frames averaged", "", _bursts(run)),
        ("Subset size (ZOI)", "", weight),
        ("Step size", "", f"{grid.step} px"),
        ("Subset shape function", "", order),
        ("Matching criterion", "", Message("weighted least squares, gain and offset of the light free")),
        ("Interpolant", "", Message("B-spline of degree 5")),
        ("Strain window", "", Message("none: gradients are parameters of each ZOI")),
        ("Virtual strain gauge size", "", Message("{size} px, one ZOI", grid.size)),
        ("Strain formulation", "", run.strain.strain_measure),
        ("Post-filtering of strains", "", Message("none")),
        ("Displacement noise floor", "", _floor(known.noise, ("u", "v"), 1.0, "px")),
        ("Strain noise floor", "", _floor(known.noise, ("exx", "eyy", "exy"), _MICRO, "µm/m")),
    ]


def _gaussian(window: str, size: int) -> str:
    return Message(" of standard deviation {sigma:.1f} px", size / 6) if window == "gaussian" else ""


def _bursts(run: RunFolder) -> str:
    frames = np.asarray(run.strain.values["n_frames"])
    references = [event for event in _reference_events(run) if event.get("n")]
    reference = Message("; reference {n}", references[0]["n"]) if references else ""
    return texts("", (f"{np.median(frames):.0f}", reference)) if len(frames) else ""


def _reference_events(run: RunFolder) -> list[dict[str, object]]:
    return [dict(event.data) for event in run.events if event.kind is EventKind.REFERENCE]


def _floor(noise: Mapping[str, NoiseFloor], names: tuple[str, ...], factor: float, unit: str) -> str:
    found = [
        Message("{name} {sigma:.3g}", one, noise[one].measured * factor) for one in names if one in noise
    ]
    still = Message(" {unit} (1 standard deviation of one ZOI, still phase)", unit)
    return texts("", (texts(", ", found), still)) if found else ""
