"""The reporting table of the Good Practices Guide for DIC, filled in from what was recorded.

International Digital Image Correlation Society, A Good Practices Guide for Digital Image Correlation (2018),
section on reporting requirements, doi:10.32720/idics/gpg.ed1. What was not recorded is marked as open;
``--meta KEY=TEXT`` at the run fills it in.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acquire.events import EventKind
from acquire.frame import CameraInfo
from acquire.text import Message, joined, word
from analysis.evaluate import NoiseFloor
from analysis.picture.pattern import describe_pattern
from analysis.quality.pattern import FWHM_OF_RADIUS, SPECKLE_RADIUS_PX
from live.results.report.page import Html, element, table
from live.results.run_folder import RunFolder

_MICRO = 1e6


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
        ("Image filtering", "", joined("; ", (wiener, *fields))),
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
    return joined("", (f"{np.median(frames):.0f}", reference)) if len(frames) else ""


def _reference_events(run: RunFolder) -> list[dict[str, object]]:
    return [dict(event.data) for event in run.events if event.kind is EventKind.REFERENCE]


def _floor(noise: Mapping[str, NoiseFloor], names: tuple[str, ...], factor: float, unit: str) -> str:
    found = [
        Message("{name} {sigma:.3g}", one, noise[one].measured * factor) for one in names if one in noise
    ]
    still = Message(" {unit} (1 standard deviation of one ZOI, still phase)", unit)
    return joined("", (joined(", ", found), still)) if found else ""
