"""What a test gives, as messages to the process of its view, and back.

What the view needs to know before the first picture.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from acquire.events import Event, EventKind
from acquire.frame import Frame
from analysis.field import Measure, StrainField, ZoiGrid
from live.pipeline.measurement import Measurement
from live.pipeline.snapshot import Snapshot
from live.ui.rerun.wire import Kind, Message, WireError

if TYPE_CHECKING:
    from analysis.field import ZoiGrid

STRAINS = ("exx", "eyy", "exy")
MAPS = (*STRAINS, "e1", "e2", "sigma", "residual", "status")
"""What is shown as maps: strains, principal strains, sigma of the strain along the load, chi squared, status."""


@dataclass(frozen=True, slots=True, eq=False)
class ViewSetup:
    """What is shown, and how.

    Attributes
    ----------
    title : str
        Name of the test, shown by the viewer.
    width, height : int, px
        Of the camera's picture.
    bits : int
        Significant bits of a sample of it.
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
        A test of the past: all that is told is shown, kept for the slider of time, and every ZOI tells its values.
    with_load : bool
        Whether there is a load to show.
    outlines : mapping of name to (((x, y), ...), ...), px
        Lines drawn on the picture: gauges.
    gauges : sequence of str
        Those whose strain is drawn over time.
    light : bool
        For slow links: pictures and maps smaller and seldom.
    scale : "symmetric" | "automatic"
        Colours of the maps about zero, or over the values there are.
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
    light: bool = False
    scale: Literal["symmetric", "automatic"] = "symmetric"


Row = tuple[float, ...]

MAX_PICTURE_BYTES = 8_000_000
"""A larger picture is sent as every second (third ...) pixel of every second row.

To slice 20 megapixels costs the test 0.7 ms, to send them whole 4 ms, to reduce them well 14 ms.
"""

COLUMNS = {Kind.MEANS: 1 + 2 * len(STRAINS), Kind.LOADS: 2, Kind.POINTS: 2, Kind.GAUGE: 3}
"""Numbers in a row: t and mean, sigma of each strain; t and N; strain and N; t and strain, sigma of a gauge."""

_NUMBERS = ("t", "axial", "sigma_axial", "force_N", "stress_Pa")


@dataclass(frozen=True, slots=True)
class ViewTarget:
    """Where the view is to be shown.

    Attributes
    ----------
    port : int or None
        Where viewers connect; the next free one is taken. None: no server.
    rrd : str or None
        A file that is not there yet.
    recording : str
        Identity of the test for the viewer.
    """

    port: int | None
    rrd: str | None
    recording: str


@dataclass(frozen=True, slots=True, eq=False)
class PictureMessage:
    """A camera's picture as it was sent: (H, W) uint8 or uint16 with every ``step``-th pixel of the frame."""

    image: NDArray[Any]
    bits: int
    t: float
    step: int


def setup_message(setup: ViewSetup, target: ViewTarget) -> Message:
    """The first message: what is shown, and where."""
    names = ("title", "width", "height", "bits", "start_monotonic", "area_m2", "axis", "strain_range")
    more = ("picture_hz", "finished", "with_load", "outlines", "gauges", "light", "scale")
    meta = {name: getattr(setup, name) for name in (*names, *more)}
    sinks = {"port": target.port, "rrd": target.rrd, "recording": target.recording}
    return Message(Kind.SETUP, {**meta, **sinks, "grid": setup.grid.to_dict()}, {"active": setup.grid.active})


def setup_of(message: Message) -> tuple[ViewSetup, ViewTarget]:
    """What ``setup_message`` was made of."""
    meta = dict(message.meta)
    try:
        target = ViewTarget(*(meta.pop(name) for name in ("port", "rrd", "recording")))
        return ViewSetup(grid=_grid(meta.pop("grid"), message), **meta), target
    except (KeyError, TypeError) as error:
        raise WireError(f"the first message to the view lacks or has too much: {error}") from error


def row_of(measurement: Measurement) -> Row:
    """Time (s), and mean and sigma of each strain."""
    i = measurement.time_step
    return (i.t, i.exx, i.sigma_exx, i.eyy, i.sigma_eyy, i.exy, i.sigma_exy)


def rows_message(kind: Kind, rows: Iterable[Row], name: str = "") -> Message:
    """Means, loads, points of the curve, or the gauge called ``name``; ``COLUMNS`` says what is in a row."""
    return Message(
        kind,
        {"name": name} if name else {},
        {"rows": np.array(list(rows), np.float64).reshape(-1, COLUMNS[kind])},
    )


def rows_of(message: Message) -> list[Row]:
    """What ``rows_message`` was made of."""
    rows = _array(message, "rows")
    if rows.ndim != 2 or rows.shape[1] != COLUMNS[message.kind]:
        raise WireError(f"a message {message.kind.name} to the view has rows {rows.shape}")
    return [tuple(row) for row in rows.tolist()]


def field_message(t: float, field: StrainField) -> Message:
    """A strain field at ``t`` (s, monotonic): what the view draws of it, as it lies in memory."""
    arrays: dict[str, NDArray[Any]] = {
        "parameters": field.parameters, "covariance": field.covariance, "status": field.status,
        "active": field.grid.active, "residual": field.residual,
    }  # fmt: skip
    return Message(Kind.FIELD, {"t": t, "grid": field.grid.to_dict(), "measure": field.measure}, arrays)


def field_of(message: Message) -> tuple[float, StrainField]:
    """Time and field; what the view does not draw of it is 0."""
    grid = _grid(message.meta.get("grid"), message)
    parameters, covariance, status = (_array(message, n) for n in ("parameters", "covariance", "status"))
    residual = _array(message, "residual")
    halves = parameters.shape[:1] in ((6,), (12,))
    if not halves or {parameters.shape[1:], covariance.shape[1:], status.shape, residual.shape} != {
        grid.shape
    }:
        raise WireError(
            f"a field to the view has shapes {parameters.shape}, {covariance.shape}, {status.shape}"
        )
    if covariance.shape[0] != 21:
        raise WireError(f"a field to the view has {covariance.shape[0]} covariances")
    nothing = np.zeros(grid.shape, np.float32)
    none = np.broadcast_to(nothing, covariance.shape)
    field = StrainField(
        grid, parameters, covariance, none, residual, status, np.zeros(grid.shape, np.uint8), nothing,
        measure=_measure(message),
    )  # fmt: skip
    return _number(message, "t"), field


def picture_message(frame: Frame) -> Message:
    """A frame, thinned where it is very large."""
    step = max(1, math.ceil(math.sqrt(frame.image.nbytes / MAX_PICTURE_BYTES)))
    image = frame.image if step == 1 else frame.image[::step, ::step]
    return Message(Kind.PICTURE, {"t": frame.t, "bits": frame.bits, "step": step}, {"image": image})


def picture_of(message: Message) -> PictureMessage:
    """What ``picture_message`` was made of."""
    image = _array(message, "image")
    if image.ndim != 2 or not image.size or image.dtype.kind != "u":
        raise WireError(f"a picture to the view is {image.shape} of {image.dtype}")
    bits, step = (int(_number(message, name)) for name in ("bits", "step"))
    return PictureMessage(image, bits, _number(message, "t"), step)


def events_message(events: Sequence[Event]) -> Message:
    """Events, without their data."""
    return Message(Kind.EVENTS, {"events": [[e.t, e.kind, e.source, e.text, e.level] for e in events]})


def events_of(message: Message) -> list[Event]:
    """What ``events_message`` was made of."""
    try:
        return [
            Event(float(t), EventKind(kind), str(source), str(text), level)
            for t, kind, source, text, level in message.meta["events"]
        ]
    except (KeyError, TypeError, ValueError) as error:
        raise WireError(f"events to the view are damaged: {error}") from error


def figures_message(snapshot: Snapshot) -> Message:
    """What is shown large of ``snapshot``."""
    shown = {name: getattr(snapshot, name) for name in (*_NUMBERS, "valid", "zois", "state", "alarms")}
    return Message(Kind.FIGURES, {k: v for k, v in shown.items() if v == v})  # NaN is no JSON


def figures_of(message: Message) -> Snapshot:
    """What ``figures_message`` was made of, as far as it is shown large."""
    meta = message.meta
    try:
        shown: dict[str, Any] = {name: float(meta.get(name, math.nan)) for name in _NUMBERS}
        shown |= {name: int(meta[name]) for name in ("valid", "zois")}
        alarms = tuple(str(alarm) for alarm in meta["alarms"])
        return Snapshot(**shown, state=str(meta["state"]), alarms=alarms)
    except (KeyError, TypeError, ValueError) as error:
        raise WireError(f"figures to the view are damaged: {error}") from error


def _measure(message: Message) -> Measure:
    said = message.meta.get("measure")
    known: tuple[Measure, ...] = get_args(Measure)
    for measure in known:
        if said == measure:
            return measure
    raise WireError(f"a field to the view is of a measure of strain {said!r} that is not known")


def _grid(description: Any, message: Message) -> ZoiGrid:
    try:
        return ZoiGrid.from_dict(description, _array(message, "active"))
    except (KeyError, TypeError, ValueError) as error:
        raise WireError(f"a message {message.kind.name} to the view has no grid: {error}") from error


def _array(message: Message, name: str) -> NDArray[Any]:
    try:
        return message.arrays[name]
    except KeyError:
        raise WireError(f"a message {message.kind.name} to the view has no array {name!r}") from None


def _number(message: Message, name: str) -> float:
    try:
        return float(message.meta[name])
    except (KeyError, TypeError, ValueError):
        raise WireError(f"a message {message.kind.name} to the view has no number {name!r}") from None
