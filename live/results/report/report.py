"""The report of one run: specimen, rig, figures, curves, maps, noise, and the files it comes from."""

from __future__ import annotations

import datetime
import math
from dataclasses import dataclass

import numpy as np

from acquire.errors import DataError
from acquire.hdf5 import storable
from analysis.evaluate import CONFIDENCE
from live.pipeline.screen import Screen
from live.results.budget import CameraView, budget_cells
from live.results.figures import (
    TensileRow,
    axis_text,
    budget_of,
    figure_lines,
    film_line,
    headline,
    sharpness_line,
)
from live.results.finished.answers import MeasuredAgain, checks_line, missing_lines
from live.results.finished.figures_file import finished_in
from live.results.finished.findings import doubts, findings
from live.results.finished.finished_test import FinishedTest
from live.results.maps.colours import number
from live.results.report import curves
from live.results.report.cycles import cycle_plots, cycle_table
from live.results.report.evaluation import EvaluatedCurve, nearest_rows, neck_line, time_steps
from live.results.report.maps import MapPictures, map_pictures, maps, statuses, whole_maps
from live.results.report.noise_floor import StillPhase, still_phase_of
from live.results.report.page import (
    Html,
    Shown,
    band,
    captioned,
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
from live.results.report.practice import PracticeValues, reporting_table
from live.results.report.record import definitions, events, frame_counts, gauges, hashes, times, version_table
from live.results.report.svg import Plot, draw
from live.results.row import LENS
from live.results.run_folder import RunFolder

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
    if not run.strain.n:
        raise DataError("{path}: holds no measurement, there is nothing to report", run.strain.path)
    content = _content(run, wanted, screen)
    for side in _SIDES:
        text = storable(page(f"{run.title}: phasedic report", _parts(content, wanted, side)))
        if len(text.encode()) < MAX_BYTES:
            break
    return Report(text, content.figures, content.test)


def _content(run: RunFolder, wanted: ReportRequest, screen: Screen) -> _Content:
    curve = EvaluatedCurve.of(run)
    chosen = nearest_rows(run, wanted.times) if wanted.times else time_steps(run, curve)
    return _Content(
        run, finished_in(run), curve, _figures(run, curve), chosen, map_pictures(run, list(chosen)),
        still_phase_of(run.strain), hashes(run, screen),
    )  # fmt: skip


def _figures(run: RunFolder, curve: EvaluatedCurve) -> tuple[Plot, ...]:
    first = [curves.stress_strain(curve), curves.true_stress_strain(curve)] if curve.has_load else []
    found = [
        *first,
        curves.force(run),
        curves.gauge_strains(run),
        curves.mean_strains(run),
        curves.valid_share(run),
    ]
    return tuple(figure for figure in found if figure is not None)


def _parts(content: _Content, wanted: ReportRequest, side: int) -> list[Html]:
    run, pictures, chosen = content.run, content.pictures, content.time_steps
    fields = wanted.fields or (run.axial,)
    reference = next((image for image in pictures.images.values() if image is not None), None)
    known = PracticeValues(run, pictures.camera, reference, content.still.floors, wanted.mm_per_px)
    return [
        _head(run, content.curve, content.test),
        section("Specimen and rig", facts(_rig(run, pictures))),
        section("Curves", plots(content.figures), _about_parts(run), _about_curves(content.curve)),
        section("Figures of the test", *figure_table(run, content.curve)),
        section("Cycles", plots(cycle_plots(content.test.cycles)), *cycle_table(content.test.cycles))
        if content.test.cycles.any
        else Html(""),
        section("Budget of E", *budget_table(run, content.curve)),
        section("Virtual gauges", gauges(run)),
        section("Lag and latency", times(run, content.test)),
        section("Maps", *(maps(run, name, chosen, pictures, side) for name in fields)),
        section("Response of each place", *whole_maps(run, min(chosen), pictures, min(side, 480))),
        section("Noise floor", *_noise_section(content)),
        *_sharpness_section(run),
        *_lens_section(run),
        section("Status of the ZOIs", statuses(run, max(chosen), pictures, min(side, 480))),
        section("Frame counts and events", frame_counts(run), events(run), *_unreadable(run)),
        fold("Reporting table (iDICs Good Practices Guide)", reporting_table(known)),
        fold("Definitions", definitions(run)),
        fold("Versions and files", version_table(run), content.files),
    ]


def _unreadable(run: RunFolder) -> list[Html]:
    return [paragraph(note, "warning") for note in run.notes]


def _head(run: RunFolder, curve: EvaluatedCurve, test: FinishedTest) -> Html:
    now = datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%d %H:%M UTC")
    words = f"Test of {run.strain.start_utc}: {run.strain.n} measurements in {run.strain.time_s[-1]:.4g} s."
    unfinished = "The results were not closed by their writer; the report has all complete rows."
    return joined(
        [
            element("h1", run.title),
            paragraph(f"{words} Report made by phasedic on {now}.", "dim"),
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
    why = f"E is not known: {test.figures.E.why if test.has_force else 'no force is known'}."
    return [
        paragraph(f"{checks_line(found)}."),
        *(band(text, "look") for text in doubts(found)),
        tiles(_tensile_tiles(curve)) if test.figures.E.known else paragraph(why, "open"),
        *(paragraph(text, "open") for text in missing_lines(test, again)),
    ]


def tensile(curve: EvaluatedCurve) -> dict[str, str]:
    """E, nu and the strengths by name, each with its uncertainty; without those that are not known."""
    return {row.name: row.text for row in _known(curve)} | _strain_of(curve)


def _tensile_tiles(curve: EvaluatedCurve) -> dict[str, Shown]:
    """``tensile`` in parts."""
    return {row.name: (row.printed, row.remark) for row in _known(curve)} | _strain_of(curve)


def _known(curve: EvaluatedCurve) -> list[TensileRow]:
    return [row for row in headline(curve.figures, stresses=curve.is_stress) if row.figure.known]


def _strain_of(curve: EvaluatedCurve) -> dict[str, str]:
    """The strain that E and nu are of; nothing where E is not known."""
    modulus = headline(curve.figures, stresses=curve.is_stress)[0]
    return {f"strain of {modulus.name}, nu": curve.figures.elastic_strain} if modulus.figure.known else {}


def _extent(run: RunFolder, curve: EvaluatedCurve) -> dict[str, str]:
    values, e = run.strain.values, curves.strain_unit(curve.axial)
    found = {"ZOIs with a value, last": f"{int(values['n_valid'][-1])} of {int(values['n_zoi'][-1])}"}
    if np.isfinite(curve.axial).any():
        largest = curve.axial[np.nanargmax(np.abs(curve.axial))] * e.factor
        name = curve.figures.strain or run.axial
        found[f"largest {name}"] = f"{number(float(f'{largest:.4g}'))} {e.name}"
    return found


def _rig(run: RunFolder, pictures: MapPictures) -> dict[str, object]:
    s, camera, grid = run.specimen, pictures.camera, run.strain.grid
    found: dict[str, object] = {str(key): value for key, value in run.strain.metadata.items()}
    known = s.width_mm is not None and s.thickness_mm is not None
    found["section"] = (
        f"{s.width_mm:g} mm x {s.thickness_mm:g} mm" if known else "not known: forces, no stresses"
    )
    found["load along"] = f"{run.load_axis.axis} of the picture"
    if direction := axis_text(run.load_axis):
        found["direction of the load"] = direction
    if camera is not None:
        fps = f", {camera.fps:g} frames/s" if camera.fps else ""
        size = f"{camera.width} x {camera.height} px, {camera.bits} bits{fps}, clock: {camera.clock}"
        found["camera"] = f"{camera.name}: {size}"
    found["camera address"] = run.camera_address or "not recorded"
    cell = run.session.load_cell if run.session is not None else None
    if cell is not None:
        found["load cell"] = cell.name + (f", capacity {cell.capacity_N:g} N" if cell.capacity_N else "")
    warnings = [*(camera.warnings if camera else ()), *(cell.warnings if cell else ())]
    if warnings:
        found["warnings of the devices"] = "; ".join(warnings)
    found["ZOIs"] = (
        f"{grid.n_active} of {grid.size} px, {grid.step} px apart, region x,y,w,h = {grid.roi.text} px"
    )
    return found


def plots(figures: tuple[Plot, ...]) -> Html:
    """Plots side by side, as many as the width allows."""
    found = [
        captioned(Html(draw(figure).replace("<svg ", '<svg class="plot" ', 1)), figure.title)
        for figure in figures
    ]
    return element("div", joined(found), class_="plots")


def _about_parts(run: RunFolder) -> Html:
    words = curves.parts(run)
    return paragraph(words, "warning") if words else Html("")


def _about_curves(curve: EvaluatedCurve) -> Html:
    if not curve.has_load:
        return paragraph("No force is known at any instant, so there is no stress-strain curve.", "dim")
    words = "Bands: one standard uncertainty on either side."
    figures = curve.figures
    if not figures.E.known:
        words += f" E is not known: {figures.E.why}."
    if figures.span is not None:
        low, high = (100 * strain for strain in figures.span.strain)
        words += (
            f" The elastic line has {figures.span.n} instants between the strains {low:.3g} and {high:.3g} %"
            f" ({figures.standard}, R^2 {figures.r2:.5f}); intervals of E, nu and Rp0.2 are of {CONFIDENCE:.0%}."
        )
    return paragraph(words, "dim")


def figure_table(run: RunFolder, curve: EvaluatedCurve) -> list[Html]:
    """The figures as text, how they were found, and why others are not known."""
    if not curve.has_load:
        return []
    lines = [*figure_lines(curve.figures, run.specimen, run.gauge_length_mm), neck_line(run, curve)]
    return [paragraph(line.strip().replace("  ", ", ")) for line in lines if line]


def _sharpness_section(run: RunFolder) -> list[Html]:
    """What a film holds back, and the blur, which results of earlier versions do not have."""
    values = run.strain.values
    lines = film_line(run.specimen)
    if "blur_px" in values:
        lines += sharpness_line(values["blur_px"].tolist(), values["sigma_blur_px"].tolist())
    return [section("Sharpness", *(paragraph(line.replace("+-", "±")) for line in lines))] * bool(lines)


def _lens_section(run: RunFolder) -> list[Html]:
    """What a corrected lens made; nothing where none is corrected."""
    values, lens = run.strain.values, run.section("lens")
    if "lens_exx" not in values:
        return []
    columns = [np.abs(np.asarray(values[name], np.float64)) for name in LENS]
    exx, eyy, sigma_exx, sigma_eyy = (
        1e6 * float(np.nanmax(one)) if np.isfinite(one).any() else math.nan for one in columns
    )
    words = (
        f"Calibrated {lens.get('date') or 'at a time not stated'}: {lens.get('method') or 'by others'}. Up to"
        f" {exx:.3g} µm/m of exx and {eyy:.3g} of eyy of the region were the lens, known to"
        f" {sigma_exx:.2g} and {sigma_eyy:.2g}; they are removed from all values."
    )
    return [section("Lens", paragraph(words))]


def budget_table(run: RunFolder, curve: EvaluatedCurve, *, both_sides: bool = False) -> list[Html]:
    """What the interval of E is made of, and what is not stated; ``both_sides``: of the mean of front and back."""
    sharpness = "no change with the load" if "blur_px" in run.strain.values else "not known"
    view = CameraView(run.stand_off_mm, run.readout_ms, bool(run.section("plate")), both_sides, sharpness)
    rows = budget_of(curve.figures, view, stresses=curve.is_stress)
    if not rows:
        return [paragraph("E is not known, so it has no budget.", "open")]
    heads, *cells = budget_cells(rows, *(("GPa", 1e9) if curve.is_stress else ("kN", 1e3)))
    modulus = headline(curve.figures, stresses=curve.is_stress)[0]
    words = (
        "Standard uncertainties, of the strain at the end of the elastic interval and of E, combined as the GUM"
        " (JCGM 100:2008) has it; limits of error are taken as even distributions. The interval of"
        f" {CONFIDENCE:.0%} of {modulus.name} = {modulus.text} is that of all together. Rows with words are not in it."
    )
    return [paragraph(words), table(heads, cells, (1, 2, 3))]


def _noise_section(content: _Content) -> list[Html]:
    n = content.still.time_steps
    if not content.still.floors:
        words = (
            "No still phase was found: fewer than two instants before anything moves. Keep the specimen at rest"
            " for a few seconds at the start of a test to measure the noise floor."
        )
        return [paragraph(words, "open")]
    rows = []
    for name, noise in content.still.floors.items():
        factor, unit = (1.0, "px") if name in ("u", "v") else (1e6, "µm/m")
        ratio = f"{noise.measured / noise.predicted:.2f}" if noise.predicted else "not known"
        rows.append((name, f"{noise.measured * factor:.3g}", f"{noise.predicted * factor:.3g}", unit, ratio))
    words = (
        f"Standard deviation of single ZOIs in the first {n} instants (to {content.run.strain.time_s[n - 1]:.4g} s),"
        " before anything moves: displacements about a plane, strains about their mean. Predicted: sigma of each"
        " value, from the noise of the pictures."
    )
    return [paragraph(words), table(("", "measured", "predicted", "", "ratio"), rows, (1, 2, 4))]
