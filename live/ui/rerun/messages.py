"""The data of a test as messages to the process of its view, and back.

The first message has the settings of the view (``ViewSetup``) and where it is shown (``ViewTarget``). Both ends are
this program: what has the form of a message (``wire.py``) is taken as it is.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from acquire.events import Event, EventKind
from acquire.frame import Frame
from acquire.text import Amount, Message, counts, joined, word
from acquire.text.message import share_text
from acquire.text.quantity import PLUS_MINUS
from analysis.field import StrainField, ZoiGrid
from live.pipeline.measurement import Measurement
from live.pipeline.snapshot import AXIAL, FORCE, STRESS, Snapshot
from live.pipeline.timed.figure import BEYOND, LACKING, FigureState, TimedFigure
from live.ui.rerun.wire import Kind, Parcel
from live.words.language import of_terminal, told

STRAINS = ("exx", "eyy", "exy")
MAPS = (*STRAINS, "e1", "e2", "sigma", "residual", "status")
"""The maps: strains, principal strains, sigma of the axial strain, chi squared, status."""

Row = tuple[float, ...]

MAX_PICTURE_BYTES = 8_000_000
"""Of a larger picture every second (third ...) pixel of every second row is sent.

For 20 megapixels, slicing takes 0.7 ms of the test, sending them whole 4 ms, and averaging 14 ms.
"""

COLUMNS = {Kind.MEANS: 1 + 2 * len(STRAINS), Kind.LOADS: 2, Kind.POINTS: 2, Kind.GAUGE: 3}
"""Columns: t and mean, sigma of each strain; t and N; strain and N; t and strain, sigma of a gauge."""

_LARGE = {Message("STRAIN"): AXIAL, Message("FORCE"): FORCE, Message("STRESS"): STRESS}


@dataclass(frozen=True, slots=True, eq=False)
class ViewSetup:
    """Settings of the view.

    Attributes
    ----------
    title : str
        Name of the test, shown by the viewer.
    width, height : int, px
        Of the picture of the camera.
    bits : int
        Significant bits of its samples.
    grid : ZoiGrid
    start_monotonic : float, s
        Zero of the timeline "time".
    area_m2 : float or None, m^2
        Cross-section; with it the curve is stress against strain, else load against strain.
    axis : "x" | "y"
        Direction of the load in the picture.
    strain_range : float or None
        Fixed symmetric range of the maps (dimensionless); None: automatic.
    picture_hz : float, 1/s
        Pictures shown per second of the test, at most.
    finished : bool
        A finished test: everything is shown and kept for the time slider, and every ZOI has a label with its values.
    with_load : bool
        Whether there is a load to show.
    outlines : mapping of name to (((x, y), ...), ...), px
        Lines of the gauges, drawn on the picture.
    gauges : sequence of str
        Names of those whose strain is plotted over time.
    colours : mapping of name to int
        The index of the colour of each gauge; without, by its place.
    light : bool
        For slow connections: smaller pictures, fewer maps.
    scale : "symmetric" | "automatic"
        Colour range of the maps: symmetric about zero; or that of the values, about zero where they have both signs.
    whole : sequence of str
        Further maps: those of the whole test.
    """

    title: str
    width: int
    height: int
    bits: int
    grid: ZoiGrid
    start_monotonic: float
    area_m2: float | None = None
    axis: Literal["x", "y"] = "y"
    strain_range: float | None = None
    picture_hz: float = 5.0
    finished: bool = False
    with_load: bool = True
    outlines: Mapping[str, tuple[tuple[tuple[float, float], ...], ...]] = field(default_factory=dict)
    gauges: Sequence[str] = ()
    colours: Mapping[str, int] = field(default_factory=dict)
    light: bool = False
    scale: Literal["symmetric", "automatic"] = "automatic"
    whole: Sequence[str] = ()


@dataclass(frozen=True, slots=True)
class LargeFigures:
    """What is painted large.

    Attributes
    ----------
    t : float, s
        Monotonic.
    cells : sequence of (label, value, tone)
        The state, then strain, force and stress. The tone of the first is its value; of others "live", "old" or
        "beyond".
    line : str
        Stands below them.
    alarmed : bool
        There are alarms or other troubles.
    """

    t: float
    cells: Sequence[tuple[str, str, str]]
    line: str
    alarmed: bool

    @classmethod
    def of(cls, s: Snapshot) -> LargeFigures:
        """Those of a test."""
        state = Message("PAUSED") if s.paused else s.state
        figures = (_cell(label, s.figure(name)) for label, name in _LARGE.items())
        cells = [(told(Message("STATE")), told(word(state)), str(state)), *figures]
        return cls(s.t, cells, _line(s), bool(s.troubles))


def _cell(name: str, figure: TimedFigure) -> tuple[str, str, str]:
    """Label, value and tone; without a value what is there instead: the last one, with its age in the label."""
    shown, said = Amount(name.lower(), figure.last, figure.sigma).printed(of_terminal()), told(name)
    label = f"{said} {shown.unit}"
    if figure.known:
        sigma = f"{PLUS_MINUS} {shown.sigma} " if shown.sigma else ""
        return f"{said} {sigma}{shown.unit}", shown.value, "live"
    if figure.state in BEYOND:
        return label, told(word(figure.state.upper())), "beyond"
    if figure.state in LACKING and figure.last == figure.last:
        old = Message("{age:.0f} s old", figure.age)
        return f"{label}  {told(old)}", shown.value, "old"
    return (
        label if figure.state is FigureState.NONE else f"{label}  {told(word(str(figure.state)))}",
        "-",
        "old",
    )


def _line(s: Snapshot) -> str:
    if s.alarms:
        return told(Message("ALARM {text}", joined("   ", s.alarms)))
    if s.troubles:
        return "   ".join(map(told, s.troubles))
    if not s.zois:
        return told(Message("nothing measured yet"))
    lost, part = s.zois - s.valid, share_text(s.area_share)
    words = Message("{valid} of {zois} ZOIs", *counts(s.valid, s.zois))
    words += Message(", {lost} LOST", lost) * (lost > 0) + Message("; strain {part}", part) * bool(part)
    return told(
        joined("   ", (words, *(joined(" ", (word(r.figure.said), r.amount)) for r in s.rows("display"))))
    )


@dataclass(frozen=True, slots=True)
class ViewTarget:
    """Where the view is shown.

    Attributes
    ----------
    port : int or None
        Where viewers connect, or the next free one. None: no server.
    rrd : str or None
        A new file. None: no file.
    recording : str
        Identifier of the test for the viewer.
    """

    port: int | None
    rrd: str | None
    recording: str


@dataclass(frozen=True, slots=True, eq=False)
class PictureMessage:
    """A received picture: (H, W) uint8 or uint16, every ``step``-th pixel of the frame."""

    image: NDArray[Any]
    bits: int
    t: float
    step: int


def setup_message(setup: ViewSetup, target: ViewTarget) -> Parcel:
    """The first message."""
    meta = {one.name: getattr(setup, one.name) for one in fields(setup) if one.name != "grid"}
    meta |= {"port": target.port, "rrd": target.rrd, "recording": target.recording}
    return Parcel(Kind.SETUP, {**meta, "grid": setup.grid.to_dict()}, {"active": setup.grid.active})


def setup_of(message: Parcel) -> tuple[ViewSetup, ViewTarget]:
    """The content of ``setup_message``."""
    meta = dict(message.meta)
    target = ViewTarget(*(meta.pop(name) for name in ("port", "rrd", "recording")))
    grid = ZoiGrid.from_dict(meta.pop("grid"), message.arrays["active"])
    return ViewSetup(grid=grid, **meta), target


def row_of(measurement: Measurement) -> Row:
    """Time (s), and mean and sigma of each strain."""
    i = measurement.time_step
    return (i.t, i.exx, i.sigma_exx, i.eyy, i.sigma_eyy, i.exy, i.sigma_exy)


def rows_message(kind: Kind, rows: Iterable[Row], name: str = "") -> Parcel:
    """Means, loads, points of the curve, or the gauge ``name``; columns as in ``COLUMNS``."""
    return Parcel(
        kind,
        {"name": name} if name else {},
        {"rows": np.array(list(rows), np.float64).reshape(-1, COLUMNS[kind])},
    )


def rows_of(message: Parcel) -> list[Row]:
    """The content of ``rows_message``."""
    return [tuple(row) for row in message.arrays["rows"].tolist()]


def field_message(t: float, field: StrainField) -> Parcel:
    """What the view draws of a strain field at ``t`` (s, monotonic); the arrays are not copied."""
    arrays: dict[str, NDArray[Any]] = {
        "parameters": field.parameters, "covariance": field.covariance, "status": field.status,
        "active": field.grid.active, "residual": field.residual,
    }  # fmt: skip
    return Parcel(Kind.FIELD, {"t": t, "grid": field.grid.to_dict(), "measure": field.measure}, arrays)


def field_of(message: Parcel) -> tuple[float, StrainField]:
    """Time and field of ``field_message``; what the view does not draw is 0."""
    meta, arrays = message.meta, message.arrays
    grid, covariance = ZoiGrid.from_dict(meta["grid"], arrays["active"]), arrays["covariance"]
    nothing = np.zeros(grid.shape, np.float32)
    none = np.broadcast_to(nothing, covariance.shape)
    field = StrainField(
        grid, arrays["parameters"], covariance, none, arrays["residual"], arrays["status"],
        np.zeros(grid.shape, np.uint8), nothing, measure=meta["measure"],
    )  # fmt: skip
    return meta["t"], field


def picture_message(frame: Frame) -> Parcel:
    """A frame, thinned where it exceeds ``MAX_PICTURE_BYTES``."""
    step = max(1, math.ceil(math.sqrt(frame.image.nbytes / MAX_PICTURE_BYTES)))
    image = frame.image if step == 1 else frame.image[::step, ::step]
    return Parcel(Kind.PICTURE, {"t": frame.t, "bits": frame.bits, "step": step}, {"image": image})


def picture_of(message: Parcel) -> PictureMessage:
    """The content of ``picture_message``."""
    return PictureMessage(message.arrays["image"], **message.meta)


def events_message(events: Sequence[Event]) -> Parcel:
    """Events in the language of the terminal, without their data."""
    return Parcel(Kind.EVENTS, {"events": [[e.t, e.kind, e.source, told(e.text), e.level] for e in events]})


def events_of(message: Parcel) -> list[Event]:
    """The content of ``events_message``."""
    rows = message.meta["events"]
    return [Event(t, EventKind(kind), source, text, level) for t, kind, source, text, level in rows]


def figures_message(snapshot: Snapshot) -> Parcel:
    """The large figures of ``snapshot``."""
    shown = LargeFigures.of(snapshot)
    return Parcel(Kind.FIGURES, {name: getattr(shown, name) for name in ("t", "cells", "line", "alarmed")})


def figures_of(message: Parcel) -> LargeFigures:
    """The content of ``figures_message``."""
    meta = message.meta
    return LargeFigures(**{**meta, "cells": [tuple(cell) for cell in meta["cells"]]})
