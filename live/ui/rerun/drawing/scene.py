"""Draws a test with rerun: pictures, maps, curves, events and status, once for all sinks, at rates of test time."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from acquire.cv2_loader import encoded
from acquire.events import Event, EventKind
from analysis.field import Status
from live.pipeline.queues import Thinned
from live.results.maps.colours import LINES, LINES_ON_DARK, number
from live.results.maps.painting import FieldMaps, Painted
from live.results.maps.scale import AutoRange, ColourScale, range_kind
from live.ui.rerun.drawing import layout, shapes
from live.ui.rerun.drawing.sinks import RerunSink
from live.ui.rerun.messages import MAPS, STRAINS, LargeFigures, PictureMessage, Row, ViewSetup

if TYPE_CHECKING:
    from analysis.field import StrainField, ZoiGrid

ON_PICTURE, ON_DARK = ([tuple(bytes.fromhex(c[1:])) for c in one] for one in (LINES, LINES_ON_DARK))
COLOURS = dict(zip(STRAINS, ON_DARK, strict=False))
RED, WHITE = (255, 90, 60), (255, 255, 255)
_LEVELS = {"info": "INFO", "warning": "WARN", "error": "ERROR"}
_RAMP = (8, 256)
_MAX_STRAINS, _MAX_FORCES = 5000, 10_000
QUALITY, MAX_PX = 80, 1280
LIGHT_QUALITY, LIGHT_MAX_PX = 50, 640
"""Of a JPEG, 1..100; larger pictures are reduced by a whole factor. With ``ViewSetup.light`` the second pair."""
FIGURES_QUALITY = 70
_ALPHA = 225  # of the maps, 0..255
_OTHER_MAPS = tuple(name for name in MAPS if name not in STRAINS)


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
        is_symmetric = setup.scale == "symmetric"
        self._maps = FieldMaps(setup.axis, setup.strain_range, is_symmetric=is_symmetric, alpha=_ALPHA)
        self._drawn: dict[str, object] = {}
        self._curve: Thinned[Row] = Thinned(layout.MAX_POINTS)
        self._drawn_curve = layout.CurveDrawing(setup)
        self._arrows = shapes.ArrowScale()
        self._strains: Thinned[Row] = Thinned(_MAX_STRAINS)
        self._forces: Thinned[Row] = Thinned(_MAX_FORCES)
        self._newest: LargeFigures | None = None

    def begin(self) -> None:
        """Draw everything that does not change."""
        import rerun as rr

        self._at(self._setup.start_monotonic)
        for name in STRAINS:
            style = rr.Measurements.from_fields(names=name, colors=COLOURS[name], widths=2.0)
            self._log(f"strain/{name}", style, static=True)
        for k, name in enumerate(self._setup.gauges):
            colour = ON_DARK[self._setup.colours.get(name, k) % len(ON_DARK)]
            style = rr.Measurements.from_fields(names=name, colors=colour, widths=2.0)
            self._log(layout.gauge_path(name), style, static=True)
        self._log("load/force", rr.SeriesLines(colors=shapes.YELLOW, names="load", widths=2.0), static=True)
        self._outlines(self._setup.grid)
        self._region(self._setup.grid)

    def end(self) -> str:
        """Draw the last figures, send what waits, and close the sinks; what failed, in words."""
        if (last := self._newest) is not None:
            self._draw_figures(last, [sink for sink in self._sinks if sink.lacks("figures", last.t)])
        sinks, self._sinks = self._sinks, []
        for sink in sinks:
            sink.send_rows()
        return "; ".join(filter(None, [sink.close() for sink in sinks]))

    # -- pictures and maps ------------------------------------------------------------------

    def picture(self, picture: PictureMessage) -> None:
        """Draw a picture as JPEG where a sink is due."""
        import rerun as rr

        self._due = [sink for sink in self._sinks if sink.takes("picture", picture.t)]
        if not self._due:
            return
        light = self._setup.light
        image, factor = shapes.reduced(picture.image, picture.bits, LIGHT_MAX_PX if light else MAX_PX)
        data = encoded(".jpg", image, LIGHT_QUALITY if light else QUALITY)
        self._at(picture.t)
        self._log_due(
            "camera/picture", rr.EncodedImage(contents=data, media_type="image/jpeg", draw_order=-10)
        )
        if factor * picture.step > 1:
            self._log_due("camera/picture", rr.Transform3D(scale=float(factor * picture.step)))
        self._count(data)

    def field(self, t: float, field: StrainField) -> None:
        """Draw a strain field at ``t`` (s, monotonic) as maps, and the curve, where a sink is due."""
        self._due = [sink for sink in self._sinks if sink.takes("map", t)]
        if not self._due:
            return
        self._at(t)
        self._specimen(field)
        self._draw_maps(field, STRAINS)
        if self._setup.finished:
            self._values(field)
        points = np.array(self._curve.items(), np.float64).reshape(-1, 2)
        changed, line = self._drawn_curve.draw(points)
        for path, archetype in changed.items():
            self._log(path, archetype)
        for path, archetype in line.items():
            self._log_due(path, archetype)
        self._due = [sink for sink in self._due if sink.takes("more", t)]
        if self._due:
            self._draw_maps(field, _OTHER_MAPS)

    def whole(self, maps: Mapping[str, NDArray[Any]]) -> None:
        """Draw the maps of the whole test, (R, C) each, by their names."""
        import rerun as rr

        for name in self._setup.whole:
            values = maps[name]
            scale = ColourScale.of(
                name, AutoRange(range_kind(name)).update(values, maps.get(f"sigma_{name}"))
            )
            painted = Painted(scale.colours(values, _ALPHA), scale)
            data = encoded(".png", painted.rgba[..., [2, 1, 0, 3]], 1)
            picture = rr.EncodedImage(contents=data, media_type="image/png", draw_order=10)
            self._log(f"specimen/map/{name}", picture, static=True)
            self._bar(name, painted, is_static=True)

    def _outlines(self, grid: ZoiGrid) -> None:
        """Draw the outlines of gauges and ZOIs, and place the maps."""
        import rerun as rr

        step = float(grid.step)
        corner = (float(grid.x[0]) + 0.5 - step / 2, float(grid.y[0]) + 0.5 - step / 2, 0.0)
        for name in (*MAPS, *self._setup.whole):
            placement = rr.Transform3D(translation=corner, scale=(step, step, 1.0))
            self._log(f"specimen/map/{name}", placement, static=True)
        lines = [[np.array(line) + 0.5 for line in lines] for lines in self._setup.outlines.values()]
        strips = [strip for gauge in lines for strip in gauge]
        if strips:
            rim = rr.LineStrips2D(strips, colors=WHITE, radii=rr.Radius.ui_points(3.0), draw_order=49)
            self._log("specimen/gauges/rim", rim, static=True)
            places = enumerate(self._setup.outlines)
            colours = [ON_PICTURE[self._setup.colours.get(n, k) % len(ON_PICTURE)] for k, n in places]
            each = [c for c, gauge in zip(colours, lines, strict=True) for _ in gauge]
            gauges = rr.LineStrips2D(strips, colors=each, radii=rr.Radius.ui_points(2.0), draw_order=50)
            self._log("specimen/gauges", gauges, static=True)
            names = shapes.text_labels([gauge[0][0] for gauge in lines], list(self._setup.outlines), WHITE)
            self._log("specimen/gauges/names", names, static=True)
        boxes = shapes.sample_boxes(grid)
        self._log(
            "specimen/zoi/boxes",
            rr.Boxes2D(
                centers=boxes,
                half_sizes=np.full_like(boxes, grid.size / 2),
                colors=(*shapes.YELLOW, 200),
                radii=rr.Radius.ui_points(0.75),
                draw_order=20,
            ),
            static=True,
        )

    def _region(self, grid: ZoiGrid) -> None:
        """Draw the edge of the measured region."""
        import rerun as rr

        edge = rr.LineStrips2D(
            shapes.region_edges(grid),
            colors=(*shapes.CYAN, 255),
            radii=rr.Radius.ui_points(1.0),
            draw_order=18,
        )
        self._log("specimen/zoi/region", edge, static=True)

    def _specimen(self, field: StrainField) -> None:
        import rerun as rr

        matrix, shift = shapes.mean_motion(field)
        self._log_due("specimen", rr.Transform3D(mat3x3=matrix, translation=shift))
        origins, vectors, factor = self._arrows.arrows(field)
        arrows = rr.LineStrips2D(
            shapes.with_heads(origins, vectors),
            colors=shapes.CYAN,
            radii=rr.Radius.ui_points(1.0),
            draw_order=30,
        )
        self._log_due("zoi/displacement", arrows)
        total, outlined = field.grid.n_active, len(shapes.sample_boxes(field.grid))
        count = f"{outlined} of {number(total)}" if outlined < total else f"all {total}"
        text = f"displacement ×{number(factor)} · {count} ZOIs outlined"
        if self._changed("words", text):
            above = [[0.5 * self._setup.width, -0.08 * layout.bar_unit(self._setup)]]
            self._log("zoi/words", shapes.text_labels(above, [text], shapes.CYAN))
        plain = field.status == Status.NO_PATTERN  # background: not rejected
        for name, selected, colour in (
            ("plain", plain, shapes.DIM),
            ("rejected", ~plain & np.isnan(field.exx), RED),
        ):
            dots = shapes.thinned(field.grid, selected & field.grid.active)
            if self._changed(name, dots.tobytes()):
                points = rr.Points2D(dots, colors=colour, radii=rr.Radius.ui_points(1.5), draw_order=25)
                self._log(f"specimen/zoi/{name}", points)

    def _draw_maps(self, field: StrainField, names: tuple[str, ...]) -> None:
        import rerun as rr

        for name, painted in self._maps.paint(field, names).items():
            data = encoded(".png", painted.rgba[..., [2, 1, 0, 3]], 1)
            picture = rr.EncodedImage(contents=data, media_type="image/png", draw_order=10)
            self._log_due(f"specimen/map/{name}", picture)
            self._count(data)
            if self._changed(f"bar/{name}", painted.scale or painted.legend):
                self._bar(name, painted)

    def _changed(self, name: str, state: object) -> bool:
        """Whether ``state`` differs from what was drawn: the memory of a server grows with everything drawn."""
        if self._drawn.get(name) == state:
            return False
        self._drawn[name] = state
        return True

    def _values(self, field: StrainField) -> None:
        """Draw a dot in each ZOI, which shows its values where a person clicks."""
        for archetype in shapes.value_dots(field):
            self._log_due(layout.VALUES, archetype)

    def _bar(self, name: str, painted: Painted, *, is_static: bool = False) -> None:
        """Draw the colours of a map with their values, or the legend of statuses."""
        import rerun as rr

        self._log(f"bar/{name}/ticks", self._ticks(painted), static=is_static)
        if painted.scale is None:
            return
        colours = painted.scale.ramp(_RAMP[1])[::-1]
        if painted.scale.is_diverging:
            colours[_RAMP[1] // 2 - 1 : _RAMP[1] // 2 + 1] = 0
        data = encoded(".png", np.repeat(colours[:, None, ::-1], _RAMP[0], axis=1), 1)
        picture = rr.EncodedImage(contents=data, media_type="image/png")
        self._log(f"bar/{name}/ramp", picture, static=is_static)
        w, h = self._setup.width, self._setup.height
        unit = layout.bar_unit(self._setup)
        scale = (layout.BAR_WIDTH * unit / _RAMP[0], layout.BAR_HEIGHT * h / _RAMP[1], 1.0)
        placement = rr.Transform3D(
            translation=(w + layout.BAR_GAP * unit, layout.BAR_TOP * h, 0.0), scale=scale
        )
        self._log(f"bar/{name}/ramp", placement, static=is_static)

    def _ticks(self, painted: Painted) -> Any:
        length, height = layout.bar_unit(self._setup), self._setup.height
        x, top = self._setup.width + layout.BAR_LABEL * length, layout.BAR_TOP * height
        if painted.scale is None:
            positions = [[x, top + 0.1 * k * length] for k in range(len(painted.legend))]
            texts = [f"{one.name} {one.count}" for one in painted.legend]
            return shapes.text_labels(positions, texts, [one.rgb for one in painted.legend])
        scale, share = painted.scale, np.array([1.0, 0.75, 0.5, 0.25, 0.0])
        y = (layout.BAR_TOP + layout.BAR_HEIGHT * (1 - share)) * height - layout.LETTER * length
        points = [*([x, yk] for yk in y), [x - 0.04 * length, top - 0.09 * length]]
        values = scale.low + share * (scale.high - scale.low)
        return shapes.text_labels(points, [*(scale.mark(float(f"{v:.6g}")) for v in values), scale.unit])

    # -- curves -------------------------------------------------------------------------------

    def points(self, points: Iterable[Row]) -> None:
        """Add points (strain, N) of the curve, drawn with the next maps."""
        for point in points:
            self._curve.append(point)

    def loads(self, samples: Iterable[Row]) -> None:
        """Add load samples (s, N)."""
        for t, force in samples:
            row = (self._since_start(t), force)
            self._forces.append(row)
            self._add(t, "load/force", row)

    def gauge(self, name: str, rows: Iterable[Row]) -> None:
        """Add rows of a gauge: time (s), strain and sigma."""
        for t, *values in rows:
            self._add(t, layout.gauge_path(name), (self._since_start(t), *values))

    def means(self, rows: Iterable[Row]) -> None:
        """Add rows of means: time (s), then mean and sigma of each strain."""
        for t, *values in rows:
            if any(math.isfinite(value) for value in values[::2]):
                row = (self._since_start(t), *values)
                self._strains.append(row)
                for k, name in enumerate(STRAINS):
                    self._add(t, f"strain/{name}", (row[0], *row[2 * k + 1 : 2 * k + 3]))
        self._send_again()

    def _add(self, t: float, path: str, row: Row) -> None:
        for sink in self._sinks:
            sink.add_row(path, row)
            if sink.takes("rows", t):
                sink.send_rows()

    def _send_again(self) -> None:
        due = [sink for sink in self._sinks if sink.needs_curves_again()]
        for sink in due:
            sink.send("load/force", self._forces.items())
            for k, name in enumerate(STRAINS):
                rows = [(row[0], *row[2 * k + 1 : 2 * k + 3]) for row in self._strains.items()]
                sink.send(f"strain/{name}", rows)
        if due:
            self._drawn = {}
            self._drawn_curve.reset()

    # -- texts --------------------------------------------------------------------------------

    def events(self, events: Iterable[Event]) -> None:
        """Add a line to the list of events for each, except for measurements."""
        import rerun as rr

        for event in events:
            if event.kind is EventKind.MEASURED:
                continue
            self._at(event.t)
            source = event.source.partition("?")[0]
            text = f"{self._since_start(event.t):.1f} s  {source}: {event.text}"
            self._log("events", rr.TextLog(text, level=_LEVELS[event.level]))

    def figures(self, shown: LargeFigures) -> None:
        """Draw the large figures where a sink is due, and the last of all at the end."""
        self._newest = shown
        self._draw_figures(shown, [sink for sink in self._sinks if sink.takes("figures", shown.t)])

    def _draw_figures(self, shown: LargeFigures, due: Sequence[RerunSink]) -> None:
        import rerun as rr

        self._due = due
        if due:
            data = encoded(".jpg", layout.paint(shown), FIGURES_QUALITY)
            self._at(shown.t)
            self._log_due("figures", rr.EncodedImage(contents=data, media_type="image/jpeg"))

    def status(self, markdown: str) -> None:
        """Draw the status card."""
        import rerun as rr

        # A server keeps everything that is static, also after it was replaced.
        card = rr.TextDocument(markdown, media_type=rr.MediaType.MARKDOWN)
        self._log("status", card, static=self._setup.finished)

    # -- rerun --------------------------------------------------------------------------------

    def _since_start(self, t: float) -> float:
        return max(t - self._setup.start_monotonic, 0.0)

    def _at(self, t: float) -> None:
        for sink in self._sinks:
            sink.stream.set_time("time", duration=self._since_start(t))

    def _log(self, path: str, archetype: Any, *, static: bool = False) -> None:
        """Draw in all sinks, for what is drawn only where it changes."""
        for sink in self._sinks:
            sink.stream.log(path, archetype, static=static)

    def _log_due(self, path: str, archetype: Any) -> None:
        for sink in self._due:
            sink.stream.log(path, archetype)

    def _count(self, data: bytes) -> None:
        for sink in self._due:
            sink.count(data)
