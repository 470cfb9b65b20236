"""The report of one run: specimen, rig, figures, curves, maps, noise, and the files it comes from."""

from __future__ import annotations

import datetime
import math
from dataclasses import dataclass

import numpy as np

from acquire.hdf5 import storable
from acquire.text import Amount, Message, counts
from acquire.text.message import counted
from acquire.text.message import joined as joined_texts
from analysis.evaluate import AT_LEAST, CONFIDENCE
from live.pipeline.consumer import Screen
from live.results.budget import CameraView, budget_cells
from live.results.figures import (
    NOT_KNOWN,
    TensileRow,
    axis_text,
    beyond_scatter,
    budget_of,
    figure_lines,
    film_line,
    headline,
    sharpness_line,
)
from live.results.finished.figures_file import MeasuredAgain, belief, checks_line, finished_in, missing_lines
from live.results.finished.findings import NO_FORCE, doubts, findings
from live.results.finished.finished_test import FinishedTest
from live.results.layout import LENS
from live.results.report import curves, record
from live.results.report.curves import long_sections
from live.results.report.evaluation import (
    EvaluatedCurve,
    StillPhase,
    nearest_rows,
    neck_line,
    still_phase_of,
    time_steps,
)
from live.results.report.maps import MapPictures, map_pictures, maps, statuses, whole_maps
from live.results.report.page import (
    Html,
    Shown,
    band,
    element,
    facts,
    fold,
    joined,
    page,
    paragraph,
    section,
    table,
    tiles,
)
from live.results.report.record import PracticeValues, reporting_table
from live.results.report.svg import Plot
from live.results.run_folder import RunFolder
from live.words.language import of_terminal, told

MAX_BYTES = 5_000_000
_SIDES = (720, 480, 320, 200)  # px, of the pictures: smaller ones where the page would be too large


@dataclass(frozen=True, slots=True)
class ReportRequest:
    """What a report shows.

    Attributes
    ----------
    fields : tuple of str
        Maps; the strain along the load where empty.
    times : tuple of float, s
        Instants of the maps; automatic where empty.
    mm_per_px : float or None
    """

    fields: tuple[str, ...] = ()
    times: tuple[float, ...] = ()
    mm_per_px: float | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Report:
    """A page, the figures on it, and the test; None of several tests."""

    html: str
    figures: tuple[Plot, ...]
    test: FinishedTest | None = None


@dataclass(frozen=True, slots=True, eq=False)
class _Content:
    """What does not depend on the size of the pictures."""

    run: RunFolder
    test: FinishedTest
    curve: EvaluatedCurve
    figures: tuple[Plot, ...]
    time_steps: dict[int, str]
    pictures: MapPictures
    still: StillPhase
    files: Html


def make_report(run: RunFolder, wanted: ReportRequest, screen: Screen) -> Report:
    """The report of ``run``, below 5 MB.

    Raises
    ------
    DataError
        Its files cannot be read, or hold no measurement, or not this map.
    """
    run.strain.check_measured()
    content = _content(run, wanted, screen)
    for side in _SIDES:
        text = storable(page(Message("{title}: phasedic report", run.title), _parts(content, wanted, side)))
        if len(text.encode()) < MAX_BYTES:
            break
    return Report(text, content.figures, content.test)


def _content(run: RunFolder, wanted: ReportRequest, screen: Screen) -> _Content:
    curve = EvaluatedCurve.of(run)
    chosen = nearest_rows(run, wanted.times) if wanted.times else time_steps(run, curve)
    return _Content(
        run, finished_in(run), curve, _figures(run, curve), chosen, map_pictures(run, list(chosen)),
        still_phase_of(run.strain), record.hashes(run, screen),
    )  # fmt: skip


def _figures(run: RunFolder, curve: EvaluatedCurve) -> tuple[Plot, ...]:
    first = [curves.stress_strain(curve), curves.true_stress_strain(curve)] if curve.has_load else []
    over_time = [
        curves.force(run),
        curves.gauge_strains(run),
        curves.mean_strains(run),
        curves.valid_share(run),
    ]
    found = [*first, *over_time, *curves.others(run)]
    return tuple(figure for figure in found if figure is not None)


def _parts(content: _Content, wanted: ReportRequest, side: int) -> list[Html]:
    run, pictures, chosen = content.run, content.pictures, content.time_steps
    fields = wanted.fields or (run.axial,)
    reference = next((image for image in pictures.images.values() if image is not None), None)
    known = PracticeValues(run, pictures.camera, reference, content.still.floors, wanted.mm_per_px)
    return [
        _head(run, content.curve, content.test),
        section(Message("Specimen and rig"), facts(_rig(run, pictures))),
        section(
            Message("Curves"), curves.plots(content.figures), _about_parts(run), _about_curves(content.curve)
        ),
        section(Message("Figures of the test"), *figure_table(run, content.curve)),
        long_sections(content.test),
        section(Message("Budget of E"), *budget_table(run, content.curve)),
        section(Message("Virtual gauges"), record.gauges(run)),
        section(Message("Lag and latency"), record.times(run, content.test)),
        section(Message("Maps"), *(maps(run, name, chosen, pictures, side) for name in fields)),
        section(Message("Response of each place"), *whole_maps(run, min(chosen), pictures, min(side, 480))),
        section(Message("Noise floor"), *_noise_section(content)),
        *_sharpness_section(run),
        *_lens_section(run),
        section(Message("Status of the ZOIs"), statuses(run, max(chosen), pictures, min(side, 480))),
        section(
            Message("Frame counts and events"),
            record.frame_counts(run),
            record.events(run),
            record.remarks(run),
        ),
        fold(Message("Reporting table (iDICs Good Practices Guide)"), reporting_table(known)),
        fold(Message("Definitions"), record.definitions(run)),
        fold(Message("Versions and files"), record.version_table(run), content.files),
    ]


def _head(run: RunFolder, curve: EvaluatedCurve, test: FinishedTest) -> Html:
    now = datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%d %H:%M UTC")
    seconds = float(run.strain.time_s[-1])
    words = Message(
        "Test of {start}: {measurements} in {seconds:.4g} s.",
        run.strain.start_utc,
        counted(run.strain.n, "measurement"),
        seconds,
    )
    made = Message(" Report made by phasedic on {now}.", now)
    unfinished = Message("The results were not closed by their writer; the report has all complete rows.")
    return joined(
        [
            element("h1", run.title),
            paragraph(words + made, "dim"),
            band(unfinished, "bad") if run.strain.unfinished else Html(""),
            tiles(_extent(run, curve)),
            *_answers(run, curve, test),
        ]
    )


def _answers(run: RunFolder, curve: EvaluatedCurve, test: FinishedTest) -> list[Html]:
    """Whether the figures can be believed, the figures or why there are none, and what is missing."""
    found, counts = findings(test), run.frame_counts or {}
    n_frames = float(np.median(run.strain.values["n_frames"]))
    again = MeasuredAgain.of(run.path, n_frames, int(counts.get("skipped", 0)) * bool(counts.get("recorded")))
    why = Message("E is not known: {why}", test.figures.E.why if test.has_force else NO_FORCE)
    warnings = [event.text for event in run.events if event.level != "info"]
    rows, held = headline(curve.figures, stresses=curve.is_stress), beyond_scatter(curve.figures)
    believed = belief(rows, [*doubts(found), *warnings], held)
    return [
        band(believed.words, believed.kind, believed.more),
        *(band(text, "look") for text in doubts(found)),
        paragraph(checks_line(found) + "."),
        tiles(_tensile_tiles(curve)) if test.figures.E.known else paragraph(why, "open"),
        *(paragraph(text, "open") for text in missing_lines(test, again)),
    ]


def tensile(curve: EvaluatedCurve) -> dict[str, str]:
    """E, nu and the strengths by name, each with its uncertainty; without those that are not known."""
    return {row.name: row.text for row in _known(curve)} | _strain_of(curve)


def _tensile_tiles(curve: EvaluatedCurve) -> dict[str, Shown]:
    """``tensile`` in parts."""
    language = of_terminal()
    rows = {row.name: (row, row.quantity.printed(language)) for row in _known(curve)}
    bound = f"{told(AT_LEAST)} "
    return {
        name: (shown._replace(value=bound * row.figure.is_bound + shown.value), row.remark)
        for name, (row, shown) in rows.items()
    } | _strain_of(curve)


def _known(curve: EvaluatedCurve) -> list[TensileRow]:
    return [row for row in headline(curve.figures, stresses=curve.is_stress) if row.figure.known]


def _strain_of(curve: EvaluatedCurve) -> dict[str, str]:
    """The strain that E and nu are of; nothing where E is not known."""
    modulus = headline(curve.figures, stresses=curve.is_stress)[0]
    name = Message("strain of {modulus}, nu", modulus.name)
    return {name: curve.figures.elastic_strain} if modulus.figure.known else {}


def _extent(run: RunFolder, curve: EvaluatedCurve) -> dict[str, str]:
    values, e = run.strain.values, curves.strain_unit(curve.axial)
    valid, zois = counts(*(int(values[name][-1]) for name in ("n_valid", "n_zoi")))
    found: dict[str, str] = {Message("ZOIs with a value, last"): Message("{valid} of {zois}", valid, zois)}
    if np.isfinite(curve.axial).any():
        largest = curve.axial[np.nanargmax(np.abs(curve.axial))]
        name = curve.figures.strain or run.axial
        largest_text = joined_texts("", [Amount("strain", float(f"{largest:.4g}"), digits=2, unit=e.name)])
        found[Message("largest {strain}", name)] = largest_text
    return found


def _rig(run: RunFolder, pictures: MapPictures) -> dict[str, object]:
    s, camera, grid = run.specimen, pictures.camera, run.strain.grid
    found: dict[str, object] = {str(key): value for key, value in run.strain.metadata.items()}
    found[Message("section")] = s.section_text or Message("not known: forces, no stresses")
    found[Message("load along")] = Message("{axis} of the picture", run.load_axis.axis)
    if direction := axis_text(run.load_axis):
        found[Message("direction of the load")] = direction
    if camera is not None:
        fps = Message(", {fps:g} frames/s", camera.fps) if camera.fps else ""
        found[Message("camera")] = Message(
            "{name}: {width} x {height} px, {bits} bits{fps}, clock: {clock}",
            camera.name, camera.width, camera.height, camera.bits, fps, camera.clock,
        )  # fmt: skip
    found[Message("camera address")] = run.camera_address or Message("not recorded")
    cell = run.session.load_cell if run.session is not None else None
    if cell is not None:
        capacity = Message(", capacity {N:g} N", cell.capacity_N) if cell.capacity_N else ""
        found[Message("load cell")] = joined_texts("", (cell.name, capacity))
    warnings = [*(camera.warnings if camera else ()), *(cell.warnings if cell else ())]
    if warnings:
        found[Message("warnings of the devices")] = joined_texts("; ", warnings)
    found["ZOIs"] = Message(
        "{n} of {size} px, {step} px apart, region x,y,w,h = {roi} px",
        *counts(grid.n_active), grid.size, grid.step, grid.roi.text,
    )  # fmt: skip
    return found


def _about_parts(run: RunFolder) -> Html:
    words = curves.parts(run)
    return paragraph(words, "warning") if words else Html("")


def _about_curves(curve: EvaluatedCurve) -> Html:
    if not curve.has_load:
        none = Message("No force is known at any instant, so there is no stress-strain curve.")
        return paragraph(none, "dim")
    words, figures = [Message("Bands: one standard uncertainty on either side.")], curve.figures
    if not figures.E.known:
        words.append(Message("E is not known: {why}", figures.E.why))
    if figures.span is not None:
        low, high = (100 * strain for strain in figures.span.strain)
        words.append(
            Message(
                "The elastic line has {n} instants between the strains {low:.3g} and {high:.3g} % ({standard}, R^2 "
                "{r2:.5f}); intervals of E, nu and Rp0.2 are of {CONFIDENCE:.0%}.",
                figures.span.n, low, high, figures.standard, figures.r2, CONFIDENCE,
            )
        )  # fmt: skip
    return paragraph(joined_texts(" ", words), "dim")


def figure_table(run: RunFolder, curve: EvaluatedCurve) -> list[Html]:
    """The figures as text, how they were found, and why others are not known."""
    if not curve.has_load:
        return []
    lines = [*figure_lines(curve.figures, run.specimen, run.gauge_length), neck_line(run, curve)]
    return [paragraph(told(line).replace("  ", ", ")) for line in lines if line]


def _sharpness_section(run: RunFolder) -> list[Html]:
    """What a film holds back, and the blur, which results of earlier versions do not have."""
    values = run.strain.values
    lines = film_line(run.specimen)
    if "blur_px" in values:
        lines += sharpness_line(values["blur_px"].tolist(), values["sigma_blur_px"].tolist())
    return [section(Message("Sharpness"), *map(paragraph, lines))] * bool(lines)


def _lens_section(run: RunFolder) -> list[Html]:
    """What a corrected lens made; nothing where none is corrected."""
    values, lens = run.strain.values, run.section("lens")
    if "lens_exx" not in values:
        return []
    columns = [np.abs(np.asarray(values[name], np.float64)) for name in LENS]
    exx, eyy, sigma_exx, sigma_eyy = (
        1e6 * float(np.nanmax(one)) if np.isfinite(one).any() else math.nan for one in columns
    )
    when = lens.get("date") or Message("at a time not stated")
    words = Message("Calibrated {date}: {method}.", when, lens.get("method") or Message("by others"))
    words += Message(
        " Up to {exx:.3g} µm/m of exx and {eyy:.3g} of eyy of the region were the lens, known to {sigma:.2g} and "
        "{sigma2:.2g}; they are removed from all values.",
        exx, eyy, sigma_exx, sigma_eyy,
    )  # fmt: skip
    return [section(Message("Lens"), paragraph(words))]


def budget_table(run: RunFolder, curve: EvaluatedCurve, *, both_sides: bool = False) -> list[Html]:
    """What the interval of E is made of, and what is not stated; ``both_sides``: of the mean of front and back."""
    sharpness = Message("no change with the load") if "blur_px" in run.strain.values else NOT_KNOWN
    view = CameraView(run.stand_off_mm, run.readout_ms, bool(run.section("plate")), both_sides, sharpness)
    rows = budget_of(curve.figures, view, stresses=curve.is_stress)
    if not rows:
        return [paragraph(Message("E is not known, so it has no budget."), "open")]
    heads, *cells = budget_cells(rows, *(("GPa", 1e9) if curve.is_stress else ("kN", 1e3)))
    modulus = headline(curve.figures, stresses=curve.is_stress)[0]
    words = Message(
        "Standard uncertainties of strain (at the end of the elastic interval) and of E, combined by the GUM (JCGM "
        "100:2008); limits of error are even distributions."
    )
    whole = Message(
        "The interval of {CONFIDENCE:.0%} of {name} = {text} is that of all together. Rows with words are not in it.",
        CONFIDENCE, modulus.name, modulus.text,
    )  # fmt: skip
    return [paragraph(joined_texts(" ", (words, whole))), table(heads, cells, (1, 2, 3))]


def _noise_section(content: _Content) -> list[Html]:
    n = content.still.time_steps
    if not content.still.floors:
        words = Message(
            "No still phase was found, so the noise floor is not known: keep the specimen at rest for a few seconds "
            "at the start of a test."
        )
        return [paragraph(words, "open")]
    rows = []
    for name, noise in content.still.floors.items():
        factor, unit = (1.0, "px") if name in ("u", "v") else (1e6, "µm/m")
        ratio = Message("{ratio:.2f}", noise.measured / noise.predicted) if noise.predicted else NOT_KNOWN
        both = (Message("{noise:.3g}", one * factor) for one in (noise.measured, noise.predicted))
        rows.append((name, *both, unit, ratio))
    words = Message(
        "Standard deviation of single ZOIs in the first {n} instants (to {t:.4g} s): displacements about a plane, "
        "strains about their mean.",
        *counts(n),
        float(content.run.strain.time_s[n - 1]),
    )
    words += Message(" Predicted: sigma of each value, from the noise of the pictures.")
    heads = ("", Message("measured"), Message("predicted"), "", Message("ratio"))
    return [paragraph(words), table(heads, rows, (1, 2, 4))]
