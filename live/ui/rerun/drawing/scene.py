"""Draws a test: pictures, maps, curves, events, status; once, for all places.

Knows rerun and the arrays; nothing of threads, processes or servers. Rates are per second of the
test (``sinks``).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from acquire.events import Event, EventKind
from analysis.field import Status
from live.pipeline.history import Thinned
from live.pipeline.snapshot import Snapshot
from live.results.maps.colours import MICROSTRAIN, number, ramp
from live.results.maps.field_maps import FieldMaps, Painted
from live.ui.rerun.drawing.curve import CYAN, DIM, MAX_POINTS, YELLOW, CurveDrawing, encode, reduced, words
from live.ui.rerun.drawing.large_figures import paint
from live.ui.rerun.drawing.layout import (
    BAR_GAP,
    BAR_HEIGHT,
    BAR_LABEL,
    BAR_TOP,
    BAR_WIDTH,
    LETTER,
    VALUES,
    bar_unit,
    gauge_path,
)
from live.ui.rerun.drawing.shapes import (
    ArrowScale,
    mean_motion,
    region_edges,
    sample_boxes,
    thinned,
    value_dots,
    with_heads,
)
from live.ui.rerun.drawing.sinks import RerunSink
from live.ui.rerun.messages import MAPS, STRAINS, PictureMessage, Row, ViewSetup

if TYPE_CHECKING:
    from analysis.field import StrainField, ZoiGrid

COLOURS = {"exx": (255, 107, 107), "eyy": (81, 207, 102), "exy": (116, 163, 255)}
GAUGES = ((255, 0, 255), (64, 224, 255), (255, 212, 59), (81, 207, 102), (255, 107, 107), (116, 163, 255))
RED, GAUGE, GAUGE_NAME = (255, 90, 60), (255, 0, 255), (255, 200, 255)
_LEVELS = {"info": "INFO", "warning": "WARN", "error": "ERROR"}
_RAMP = (8, 256)
_STRAINS_KEPT, _FORCES_KEPT = 5000, 10_000
QUALITY, MAX_PX = 80, 1280
FIGURES_QUALITY = 70
LIGHT_QUALITY, LIGHT_MAX_PX = 50, 640
"""Of the JPEG, 1..100; larger pictures are reduced by a whole factor."""
_ALPHA = 225  # of the maps, 0..255
_MORE = tuple(name for name in MAPS if name not in STRAINS)


class ViewScene:
    """Draws into ``sinks``; every method may raise whatever rerun raises.

    Parameters
    ----------
    sinks : sequence of RerunSink
    setup : ViewSetup
    """

    def __init__(self, sinks: Sequence[RerunSink], setup: ViewSetup) -> None:
        self._sinks, self._setup = sinks, setup
        self._due: Sequence[RerunSink] = sinks
        symmetric = setup.scale == "symmetric"
        self._maps = FieldMaps(setup.axis, setup.strain_range, about_zero=symmetric, alpha=_ALPHA)
        self._drawn: dict[str, object] = {}
        self._curve: Thinned[Row] = Thinned(MAX_POINTS)
        self._drawn_curve = CurveDrawing(self._log_due, self._log, setup)
        self._arrows = ArrowScale()
        self._strains: Thinned[Row] = Thinned(_STRAINS_KEPT)
        self._forces: Thinned[Row] = Thinned(_FORCES_KEPT)

    def begin(self) -> None:
        """All that does not change."""
        import rerun as rr

        self._at(self._setup.start_monotonic)
        for name in MAPS:
            if name != "status":
                self._bar(name)
        for name in STRAINS:
            style = rr.Measurements.from_fields(names=name, colors=COLOURS[name], widths=2.0)
            self._log(f"strain/{name}", style, static=True)
        for k, name in enumerate(self._setup.gauges):
            style = rr.Measurements.from_fields(names=name, colors=GAUGES[k % len(GAUGES)], widths=2.0)
            self._log(gauge_path(name), style, static=True)
        self._log("load/force", rr.SeriesLines(colors=YELLOW, names="load", widths=2.0), static=True)
        self._outlines(self._setup.grid)
        self._region(self._setup.grid)

    def end(self) -> None:
        """All is drawn: let it reach its places, and close those."""
        for sink in self._sinks:
            sink.send_rows(_columns)
            sink.close()
        self._sinks = []

    # -- pictures and maps ------------------------------------------------------------------

    def picture(self, picture: PictureMessage) -> None:
        """A picture, as JPEG, no more often than the rates say."""
        import rerun as rr

        self._due = [sink for sink in self._sinks if sink.takes("picture", picture.t)]
        if not self._due:
            return
        light = self._setup.light
        image, factor = reduced(picture.image, picture.bits, LIGHT_MAX_PX if light else MAX_PX)
        data = encode(".jpg", image, LIGHT_QUALITY if light else QUALITY)
        self._at(picture.t)
        self._log_due(
            "camera/picture", rr.EncodedImage(contents=data, media_type="image/jpeg", draw_order=-10)
        )
        if factor * picture.step > 1:
            self._log_due("camera/picture", rr.Transform3D(scale=float(factor * picture.step)))
        self._count(data)

    def field(self, t: float, field: StrainField) -> None:
        """A strain field at ``t`` (s, monotonic) as maps, no more often than the rates say; and the curve."""
        self._due = [sink for sink in self._sinks if sink.takes("map", t)]
        if not self._due:
            return
        self._at(t)
        self._specimen(field)
        self._draw_maps(field, STRAINS)
        if self._setup.finished:
            self._values(field)
        points = np.array(self._curve.items(), np.float64).reshape(-1, 2)
        self._drawn_curve.draw(points)
        self._due = [sink for sink in self._due if sink.takes("more", t)]
        if self._due:
            self._draw_maps(field, _MORE)

    def _outlines(self, grid: ZoiGrid) -> None:
        """The outlines of the ZOIs, and where the maps lie."""
        import rerun as rr

        step = float(grid.step)
        corner = (float(grid.x[0]) + 0.5 - step / 2, float(grid.y[0]) + 0.5 - step / 2, 0.0)
        for name in MAPS:
            sink = rr.Transform3D(translation=corner, scale=(step, step, 1.0))
            self._log(f"specimen/map/{name}", sink, static=True)
        lines = [[np.array(line) + 0.5 for line in lines] for lines in self._setup.outlines.values()]
        strips = [strip for gauge in lines for strip in gauge]
        if strips:
            gauges = rr.LineStrips2D(
                strips,
                colors=GAUGE,
                radii=rr.Radius.ui_points(2.0),
                draw_order=50,
            )
            self._log("specimen/gauges", gauges, static=True)
            names = words([gauge[0][0] for gauge in lines], list(self._setup.outlines), GAUGE_NAME)
            self._log("specimen/gauges/names", names, static=True)
        boxes = sample_boxes(grid)
        self._log(
            "specimen/zoi/boxes",
            rr.Boxes2D(
                centers=boxes,
                half_sizes=np.full_like(boxes, grid.size / 2),
                colors=(*YELLOW, 200),
                radii=rr.Radius.ui_points(0.75),
                draw_order=20,
            ),
            static=True,
        )

    def _region(self, grid: ZoiGrid) -> None:
        """The edge of what is measured."""
        import rerun as rr

        edge = rr.LineStrips2D(
            region_edges(grid), colors=(*CYAN, 255), radii=rr.Radius.ui_points(1.0), draw_order=18
        )
        self._log("specimen/zoi/region", edge, static=True)

    def _specimen(self, field: StrainField) -> None:
        import rerun as rr

        matrix, shift = mean_motion(field)
        self._log_due("specimen", rr.Transform3D(mat3x3=matrix, translation=shift))
        origins, vectors, factor = self._arrows.arrows(field)
        arrows = rr.LineStrips2D(
            with_heads(origins, vectors), colors=CYAN, radii=rr.Radius.ui_points(1.0), draw_order=30
        )
        self._log_due("zoi/displacement", arrows)
        total, outlined = field.grid.n_active, len(sample_boxes(field.grid))
        some = f"{outlined} of {number(total)}" if outlined < total else f"all {total}"
        text = f"displacement ×{number(factor)} · {some} ZOIs outlined"
        if self._changed("words", text):
            sink = [[0.5 * self._setup.width, -0.08 * bar_unit(self._setup)]]
            self._log("zoi/words", words(sink, [text], CYAN))
        plain = field.status == Status.NO_PATTERN  # background, where nothing is to be lost
        for name, wanted, colour in (("plain", plain, DIM), ("rejected", ~plain & np.isnan(field.exx), RED)):
            dots = thinned(field.grid, wanted & field.grid.active)
            if self._changed(name, dots.tobytes()):
                points = rr.Points2D(dots, colors=colour, radii=rr.Radius.ui_points(1.5), draw_order=25)
                self._log(f"specimen/zoi/{name}", points)

    def _draw_maps(self, field: StrainField, names: tuple[str, ...]) -> None:
        import rerun as rr

        for name, painted in self._maps.paint(field, names).items():
            data = encode(".png", painted.rgba[..., [2, 1, 0, 3]], 1)
            picture = rr.EncodedImage(contents=data, media_type="image/png", draw_order=10)
            self._log_due(f"specimen/map/{name}", picture)
            self._count(data)
            if self._changed(f"bar/{name}", painted.scale or painted.legend):
                self._log(f"bar/{name}/ticks", self._ticks(painted))

    def _changed(self, what: str, says: object) -> bool:
        """Whether it is to be drawn anew: a server's memory grows with each thing drawn."""
        if self._drawn.get(what) == says:
            return False
        self._drawn[what] = says
        return True

    def _values(self, field: StrainField) -> None:
        """A dot in each ZOI that tells its values where a person clicks."""
        for part in value_dots(field):
            self._log_due(VALUES, part)

    def _bar(self, name: str) -> None:
        import rerun as rr

        w, h = self._setup.width, self._setup.height
        data = encode(".png", ramp(_RAMP[1], _RAMP[0])[..., ::-1], 1)
        self._log(f"bar/{name}/ramp", rr.EncodedImage(contents=data, media_type="image/png"), static=True)
        unit = bar_unit(self._setup)
        scale = (BAR_WIDTH * unit / _RAMP[0], BAR_HEIGHT * h / _RAMP[1], 1.0)
        sink = rr.Transform3D(translation=(w + BAR_GAP * unit, BAR_TOP * h, 0.0), scale=scale)
        self._log(f"bar/{name}/ramp", sink, static=True)

    def _ticks(self, painted: Painted) -> Any:
        length, height = bar_unit(self._setup), self._setup.height
        x, top = self._setup.width + BAR_LABEL * length, BAR_TOP * height
        if painted.scale is None:
            sinks = [[x, top + 0.1 * k * length] for k in range(len(painted.legend))]
            texts = [f"{one.name} {one.count}" for one in painted.legend]
            return words(sinks, texts, [one.rgb for one in painted.legend])
        scale, share = painted.scale, np.array([1.0, 0.75, 0.5, 0.25, 0.0])
        y = (BAR_TOP + BAR_HEIGHT * (1 - share)) * height - LETTER * length
        points = [*([x, yk] for yk in y), [x - 0.04 * length, top - 0.09 * length]]
        values = scale.low + share * (scale.high - scale.low)
        return words(points, [*(number(float(f"{v:.6g}")) for v in values), scale.unit])

    # -- curves -------------------------------------------------------------------------------

    def points(self, points: Iterable[Row]) -> None:
        """Points (strain, N) of the curve, drawn with the next maps."""
        for point in points:
            self._curve.append(point)

    def loads(self, samples: Iterable[Row]) -> None:
        """Load samples (s, N)."""
        for t, force in samples:
            row = (self._since_start(t), force)
            self._forces.append(row)
            self._add(t, "load/force", row)

    def gauge(self, name: str, rows: Iterable[Row]) -> None:
        """Time (s), strain and sigma of a gauge."""
        for t, *values in rows:
            self._add(t, gauge_path(name), (self._since_start(t), *values))

    def means(self, rows: Iterable[Row]) -> None:
        """Time (s), and mean and sigma of each strain."""
        for t, *values in rows:
            if any(math.isfinite(value) for value in values[::2]):
                row = (self._since_start(t), *values)
                self._strains.append(row)
                self._add_strains(t, row)
        self._repeat()

    def _add_strains(self, t: float, row: Row) -> None:
        for k, name in enumerate(STRAINS):
            self._add(t, f"strain/{name}", (row[0], *row[2 * k + 1 : 2 * k + 3]))

    def _add(self, t: float, path: str, row: Row) -> None:
        for sink in self._sinks:
            sink.add_row(path, row)
            if sink.takes("rows", t):
                sink.send_rows(_columns)

    def _repeat(self) -> None:
        forgetting = [sink for sink in self._sinks if sink.forgets()]
        for sink in forgetting:
            sink.send("load/force", self._forces.items(), _columns)
            for k, name in enumerate(STRAINS):
                rows = [(row[0], *row[2 * k + 1 : 2 * k + 3]) for row in self._strains.items()]
                sink.send(f"strain/{name}", rows, _columns)
        if forgetting:
            self._drawn = {}
            self._drawn_curve.forget()

    # -- words --------------------------------------------------------------------------------

    def event(self, event: Event) -> None:
        """One line in the list of events; not one for each measurement."""
        import rerun as rr

        if event.kind is EventKind.MEASURED:
            return
        self._at(event.t)
        source = event.source.partition("?")[0]
        text = f"{self._since_start(event.t):.1f} s  {source}: {event.text}"
        self._log("events", rr.TextLog(text, level=_LEVELS[event.level]))

    def figures(self, snapshot: Snapshot) -> None:
        """The large figures, no more often than the rates say."""
        import rerun as rr

        self._due = [sink for sink in self._sinks if sink.takes("figures", snapshot.t)]
        if self._due:
            data = encode(".jpg", paint(snapshot), FIGURES_QUALITY)
            self._at(snapshot.t)
            self._log_due("figures", rr.EncodedImage(contents=data, media_type="image/jpeg"))

    def status(self, markdown: str) -> None:
        """The status card."""
        import rerun as rr

        # What is static a server keeps for ever, each of them.
        card = rr.TextDocument(markdown, media_type=rr.MediaType.MARKDOWN)
        self._log("status", card, static=self._setup.finished)

    # -- rerun --------------------------------------------------------------------------------

    def _since_start(self, t: float) -> float:
        return max(t - self._setup.start_monotonic, 0.0)

    def _at(self, t: float) -> None:
        for sink in self._sinks:
            sink.stream.set_time("time", duration=self._since_start(t))

    def _log(self, path: str, what: Any, *, static: bool = False) -> None:
        """To all places: what is drawn only where it changes."""
        for sink in self._sinks:
            sink.stream.log(path, what, static=static)

    def _log_due(self, path: str, what: Any) -> None:
        for sink in self._due:
            sink.stream.log(path, what)

    def _count(self, data: bytes) -> None:
        for sink in self._due:
            sink.count(data)


def _columns(path: str, values: Sequence[Any]) -> Any:
    """Rerun's columns of what is drawn over time."""
    import rerun as rr

    if path == "load/force":
        return rr.Scalars.columns(scalars=values[0])
    means, sigmas = (value * MICROSTRAIN.factor for value in values)
    return rr.Measurements.columns(values=means, variances=sigmas**2)
