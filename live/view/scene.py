"""Draws a test into one rerun stream: pictures, maps, curves, events, status.

Knows rerun and the arrays; nothing of threads, queues or servers (``publisher``). Rates are
per second of the test, so that a replay draws what the live run drew.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np

from acquire.events import Event, EventKind
from live.maps import MICROSTRAIN, AutoRange, Unit, colour, number, ramp, unit_for
from live.view.curve import MAX_POINTS
from live.view.curve_drawing import CurveDrawing
from live.view.layout import BAR_GAP, BAR_HEIGHT, BAR_LABEL, BAR_TOP, BAR_WIDTH, LETTER, bar_unit
from live.view.marks import CYAN, YELLOW, encode, reduced, words
from live.view.setup import STRAINS, Rates, ViewSetup
from live.view.shapes import ArrowScale, mean_motion, sample_boxes, thinned
from live.view.thinned import Thinned

if TYPE_CHECKING:
    from acquire.frame import Frame
    from analysis.field import StrainField, ZoiGrid
    from live.measure import Measurement

COLOURS = {"exx": (255, 107, 107), "eyy": (81, 207, 102), "exy": (116, 163, 255)}
RED = (255, 90, 60)
MAP_ALPHA = 225
_LEVELS = {"info": "INFO", "warning": "WARN", "error": "ERROR"}
_LOAD_STEP_S = 0.02
_FLUSH_S = 10.0
_RAMP = (8, 256)
_STRAINS_KEPT, _FORCES_KEPT = 5000, 10_000


class Scene:
    """Draws into ``stream``; every method may raise whatever rerun raises.

    Parameters
    ----------
    stream : rerun.RecordingStream
    setup : ViewSetup
    rates : Rates
    """

    def __init__(self, stream: Any, setup: ViewSetup, rates: Rates) -> None:
        self.stream, self._setup, self._rates = stream, setup, rates
        self._ranges = {name: AutoRange(setup.strain_range) for name in STRAINS}
        self._limits: dict[str, float] = {}
        self._curve: Thinned[tuple[float, float]] = Thinned(MAX_POINTS)
        self._drawn_curve = CurveDrawing(self._log, setup)
        self._arrows = ArrowScale()
        self._picture_t = self._map_t = self._load_t = -math.inf
        self._strains: Thinned[tuple[float, ...]] = Thinned(_STRAINS_KEPT)
        self._forces: Thinned[tuple[float, float]] = Thinned(_FORCES_KEPT)
        self.drawn_bytes = self._repeated_at = 0

    def begin(self) -> None:
        """All that does not change."""
        import rerun as rr

        for name in STRAINS:
            self._bar(name)
        for name in STRAINS:
            style = rr.Measurements.from_fields(names=name, colors=COLOURS[name], widths=2.0)
            self._log(f"strain/{name}", style, static=True)
        self._log("load/force", rr.SeriesLines(colors=YELLOW, names="load", widths=2.0), static=True)
        self._outlines(self._setup.grid)

    def end(self) -> None:
        """All is drawn: let it reach its place, and close that."""
        self.stream.flush(timeout_sec=_FLUSH_S)
        self.stream.disconnect()

    # -- pictures and maps ------------------------------------------------------------------

    def picture(self, frame: Frame) -> None:
        """The newest picture, as JPEG, no more often than the rates say."""
        if not self._due(frame.t, self._picture_t, self._rates.picture_hz):
            return
        self._picture_t = frame.t
        import rerun as rr

        image, factor = reduced(frame.image, frame.bits, self._rates.longest_px)
        data = encode(".jpg", image, self._rates.quality)
        self._at(frame.t)
        self._log("camera/picture", rr.EncodedImage(contents=data, media_type="image/jpeg", draw_order=-10))
        if factor > 1:
            self._log("camera/picture", rr.Transform3D(scale=float(factor)))
        self.drawn_bytes += len(data)

    def measurement(self, measurement: Measurement) -> None:
        """Curves always, maps no more often than the rates say."""
        field, t = measurement.field, measurement.t
        self._at(t)
        i = measurement.instant
        means = {name: (getattr(i, name), getattr(i, f"sigma_{name}")) for name in STRAINS}
        self._mean_strain(t, means)
        self._repeat()
        if not self._due(t, self._map_t, self._rates.map_hz):
            return
        self._map_t = t
        self._specimen(field)
        for name in STRAINS:
            self._map(field, name)
        self._bar_labels()
        points = np.array(self._curve.items(), np.float64).reshape(-1, 2)
        self._drawn_curve.draw(points)

    def _outlines(self, grid: ZoiGrid) -> None:
        """The outlines of the ZOIs, and where the maps lie."""
        import rerun as rr

        step = float(grid.step)
        corner = (float(grid.x[0]) + 0.5 - step / 2, float(grid.y[0]) + 0.5 - step / 2, 0.0)
        for name in STRAINS:
            place = rr.Transform3D(translation=corner, scale=(step, step, 1.0))
            self._log(f"specimen/map/{name}", place, static=True)
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

    def _specimen(self, field: StrainField) -> None:
        import rerun as rr

        matrix, shift = mean_motion(field)
        self._log("specimen", rr.Transform3D(mat3x3=matrix, translation=shift))
        origins, vectors, factor = self._arrows.arrows(field)
        self._log(
            "zoi/displacement",
            rr.Arrows2D(
                origins=origins, vectors=vectors, colors=CYAN, radii=rr.Radius.ui_points(1.0), draw_order=30
            ),
        )
        total, outlined = field.grid.n_active, len(sample_boxes(field.grid))
        some = f"{outlined} of {number(total)}" if outlined < total else f"all {total}"
        text = f"displacement ×{number(factor)} · {some} ZOIs outlined"
        self._log(
            "zoi/words", words([[0.5 * self._setup.width, -0.08 * bar_unit(self._setup)]], [text], CYAN)
        )
        lost = thinned(field.grid, np.isnan(field.exx) & field.grid.active)
        self._log(
            "specimen/zoi/rejected",
            rr.Points2D(lost, colors=RED, radii=rr.Radius.ui_points(1.5), draw_order=25),
        )

    def _map(self, field: StrainField, name: str) -> None:
        import rerun as rr

        values = getattr(field, name)
        limit = self._ranges[name].update(values, getattr(field, f"sigma_{name}"))
        data = encode(".png", colour(values, limit, MAP_ALPHA)[..., [2, 1, 0, 3]], 1)
        picture = rr.EncodedImage(contents=data, media_type="image/png", draw_order=10)
        self._log(f"specimen/map/{name}", picture)
        self.drawn_bytes += len(data)

    def _bar(self, name: str) -> None:
        import rerun as rr

        w, h = self._setup.width, self._setup.height
        data = encode(".png", ramp(_RAMP[1], _RAMP[0])[..., ::-1], 1)
        self._log(f"bar/{name}/ramp", rr.EncodedImage(contents=data, media_type="image/png"), static=True)
        unit = bar_unit(self._setup)
        scale = (BAR_WIDTH * unit / _RAMP[0], BAR_HEIGHT * h / _RAMP[1], 1.0)
        place = rr.Transform3D(translation=(w + BAR_GAP * unit, BAR_TOP * h, 0.0), scale=scale)
        self._log(f"bar/{name}/ramp", place, static=True)

    def _bar_labels(self) -> None:
        limits = {name: self._ranges[name].limit for name in STRAINS}
        if limits == self._limits:
            return
        self._limits = limits
        unit = unit_for(max(limits.values()))
        for name, limit in limits.items():
            self._log(f"bar/{name}/ticks", self._ticks(limit, unit))

    def _ticks(self, limit: float, unit: Unit) -> Any:
        share, length = np.array([1.0, 0.5, 0.0, -0.5, -1.0]), bar_unit(self._setup)
        y = (BAR_TOP + BAR_HEIGHT * (1 - share) / 2) * self._setup.height - LETTER * length
        x, top = self._setup.width + BAR_LABEL * length, BAR_TOP * self._setup.height
        points = [*([x, yk] for yk in y), [x - 0.04 * length, top - 0.09 * length]]
        return words(points, [*(number(s * limit * unit.factor) for s in share), unit.name])

    def points(self, points: Iterable[tuple[float, float]]) -> None:
        """Points (strain, N) of the curve, drawn with the next maps."""
        for strain, force in points:
            if math.isfinite(strain) and math.isfinite(force):
                self._curve.append((strain, force))

    # -- curves -------------------------------------------------------------------------------

    def loads(self, samples: Iterable[tuple[float, float]]) -> None:
        """Load samples (s, N), thinned to 50 a second."""
        kept = []
        for t, force in samples:
            if t - self._load_t >= _LOAD_STEP_S and math.isfinite(force):
                kept.append((self._since_start(t), force))
                self._forces.append(kept[-1])
                self._load_t = t
        self._send_loads(kept)

    def _send_loads(self, samples: list[tuple[float, float]]) -> None:
        import rerun as rr

        if not samples:
            return
        times, forces = np.array(samples).T
        index = [rr.TimeColumn("time", duration=times)]
        self.stream.send_columns("load/force", index, rr.Scalars.columns(scalars=forces))

    def _mean_strain(self, t: float, means: dict[str, tuple[float, float]]) -> None:
        if any(math.isfinite(value) for value, _ in means.values()):
            row = (self._since_start(t), *(x for name in STRAINS for x in means[name]))
            self._strains.append(row)
            self._send_strains([row])

    def _send_strains(self, rows: list[tuple[float, ...]]) -> None:
        import rerun as rr

        table = np.array(rows)
        index = [rr.TimeColumn("time", duration=table[:, 0])]
        shown = table[:, 1:] * MICROSTRAIN.factor
        for k, name in enumerate(STRAINS):
            columns = rr.Measurements.columns(values=shown[:, 2 * k], variances=shown[:, 2 * k + 1] ** 2)
            self.stream.send_columns(f"strain/{name}", index, columns)

    def _repeat(self) -> None:
        if self.drawn_bytes - self._repeated_at < self._rates.repeat_bytes:
            return
        self._repeated_at = self.drawn_bytes
        self._send_strains(self._strains.items())
        self._send_loads(self._forces.items())
        self._limits = {}
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

    def status(self, markdown: str) -> None:
        """The status card."""
        import rerun as rr

        self._log("status", rr.TextDocument(markdown, media_type=rr.MediaType.MARKDOWN), static=True)

    # -- rerun --------------------------------------------------------------------------------

    def _due(self, t: float, last: float, rate: float) -> bool:
        return self.drawn_bytes < self._rates.limit_bytes and t - last >= 0.999 / rate

    def _since_start(self, t: float) -> float:
        return max(t - self._setup.start_monotonic, 0.0)

    def _at(self, t: float) -> None:
        self.stream.set_time("time", duration=self._since_start(t))

    def _log(self, path: str, what: Any, *, static: bool = False) -> None:
        self.stream.log(path, what, static=static)
