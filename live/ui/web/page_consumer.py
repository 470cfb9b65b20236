"""The page as a consumer of a run: state ten times a second, a map four times a second, points of the curves.

The measuring thread only stores the measurement; the thread of the consumer does everything else, and draws the
map only while a page is open.
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from acquire.clock import Clock
from acquire.errors import DataError
from acquire.events import Event, EventKind
from acquire.frame import Frame
from acquire.text import Amount, Message
from acquire.text.message import printable, share_text
from analysis.evaluate import ExtensionGauge, LineGauge
from live.config.gauges import complete_gauges, gauge_colours
from live.config.loading import Config
from live.pipeline.consumer import Consumer, Policy
from live.pipeline.event_log import Repeats, counted_text, sentence
from live.pipeline.measurement import AXIAL, Measurement, TimeStep
from live.pipeline.run_state import RunState
from live.pipeline.snapshot import BURST, FORCE, STRESS, ChannelValues, ShownFigure, Snapshot, peak_force
from live.pipeline.timed.course import shown_names
from live.pipeline.timed.figure import TimedFigure
from live.results.reader import whole_maps
from live.results.run_folder import STRAIN
from live.ui.web.broadcaster import Broadcaster
from live.ui.web.map_view import MapView, as_jpeg, gauge_shapes, plate_shapes, shrunk
from live.ui.web.run_panels import CamerasPanel, CurveHistory, FigureLimits

if TYPE_CHECKING:
    from live.run.camera_run import CameraRun
    from live.run.live_run import LiveRun

MAX_EVENTS = 30
STATE_S, PICTURE_S = 0.1, 0.25
"""Between states and between pictures."""


class PageConsumer(Consumer):
    """Sends the state of a run to the pages.

    Parameters
    ----------
    broadcaster : Broadcaster
    config : Config
    now : callable giving monotonic seconds
    picture : bytes
        Shown until there is one of the run, as JPEG.
    side : str
        The name of the camera, which its messages carry; empty where there is only one.
    cameras : int
        How many share the time for drawing.

    Attributes
    ----------
    picture : bytes
        The newest picture as JPEG: the camera's alone; after the run that at the highest force with its map.
    layers : dict of str to bytes
        What else belongs to it: the ``map`` as PNG to lay over it; after the run the ``last`` picture with its map.
    curve : CurveHistory
    map : MapView
    """

    name = "page"
    policy = Policy.NEWEST
    timeout_s = 5.0

    def __init__(
        self,
        broadcaster: Broadcaster,
        config: Config,
        now: Clock = time.monotonic,
        picture: bytes = b"",
        side: str = "",
        cameras: int = 1,
    ) -> None:
        self._kind, self._side, self._sharing = f"run {side}".strip(), side, cameras
        self._broadcaster, self._config, self._now = broadcaster, config, now
        self.map = MapView(config)
        names = list(config.gauges) or ["exx", "eyy", "exy"]
        load = "stress" if config.specimen.area_m2 else "force"
        self._names, self._colours = names, gauge_colours(config.gauges)
        self.curve = CurveHistory(["t", load, "axial", *names], [self._colours.get(name) for name in names])
        self.picture = picture
        self.layers: dict[str, bytes] = {}
        self._limits = FigureLimits(config.alarm)
        self._shown = 0
        self._scale: dict[str, Any] = {}
        self._running: LiveRun | CameraRun | None = None
        self._cameras: CamerasPanel | None = None
        self._newest: Measurement | None = None
        self._matched: Measurement | None = None
        self._peak: Measurement | None = None
        self._peak_N = math.nan
        self._frame: Frame | None = None
        self._fresh = False
        self._events = Repeats()
        self._start_t = now()
        self._t0 = math.nan
        self._channels: ChannelValues | None = None
        self._rate = (math.nan, math.nan)  # and its sigma
        self._elongation_gauge, self._length_mm, self._length_share = elongation_length(config)
        self._due = {"state": 0.0, "picture": 0.0}

    def attach(
        self, running: LiveRun | CameraRun, states: Mapping[str, RunState] = MappingProxyType({})
    ) -> None:
        """Use ``running``, which has begun; ``states`` are those of the cameras of a test with several."""
        if len(states) > 1:
            self._cameras = CamerasPanel(states, self._config.specimen, self._now)
        self._running, self._start_t = running, running.run_state.health.began_t
        self.map.response = running.run_state.response.maps
        self._channels = ChannelValues(self._start_t, running.run_state)

    def select_map(self, request: Mapping[str, Any]) -> str:
        """Show another map or range; the reason of a refusal, or empty."""
        choice = self.map.choice
        refusal = self.map.choose(
            request.get("of"), request.get("range", choice.span), request.get("limit", choice.limit)
        )
        self._fresh = self._fresh or not refusal
        return refusal

    # -- data of a run ------------------------------------------------------------------------

    def measurement(self, measurement: Measurement) -> None:
        """Keep the newest measurement."""
        self._newest, self._fresh = measurement, True

    def matched(self, measurement: Measurement) -> None:
        """Add a point of the curves; keep the measurement at the highest force."""
        i, running = measurement.time_step, self._running
        self._matched = measurement
        if math.isnan(self._t0):
            self._t0 = i.t
        first_axis = self._config.specimen.first_axis
        axis = first_axis if running is None else running.run_state.history.current_axis
        strains = [i.gauges[n].value if n in i.gauges else getattr(i, n, math.nan) for n in self._names]
        stress = i.force / (self._config.specimen.area_m2 or 1.0)
        axial = i.axial(axis)[0]
        self.curve.add([i.t - self._t0, stress, axial, *strains])
        self._limits.add(i.t, {FORCE: i.force, STRESS: stress, AXIAL: axial})
        if self._channels is not None:
            read = self._channels.read(measurement)
            self._rate = read["strain_rate"], read["sigma_strain_rate"]
        # The measurement at the force of largest magnitude; without a force the last one.
        force = measurement.time_step.force
        self._peak_N = peak_force(self._peak_N, force)
        if self._peak is None or math.isnan(self._peak_N) or self._peak_N == force:
            self._peak = measurement

    def frame(self, frame: Frame) -> None:
        """Keep the newest frame, shown until something is measured."""
        if self._newest is None and not frame.damaged:
            self._frame, self._fresh = frame, True

    def event(self, event: Event) -> None:
        """Keep the last events; of repeated ones the newest with their number."""
        if event.kind is EventKind.MEASURED:
            return
        names = {} if self._running is None else self._running.run_state.event_log.names
        self._events.add(replace(event, t=self._now(), text=printable(sentence(event, names))))

    def idle(self) -> float:
        """Send and draw what is due."""
        now = self._now()
        if now >= self._due["state"]:
            self._due["state"] = now + STATE_S
            self._broadcaster.publish(self._kind, self.state())
        if now >= self._due["picture"] and self._fresh and self._broadcaster.open_pages:
            self._draw()
            # Drawing takes at most a fifth of the time, also with large pictures and of several cameras together.
            rest = (5 * self._sharing - 1) * (self._now() - now)
            self._due["picture"] = max(now + PICTURE_S, self._now() + rest)
        return STATE_S

    def end(self) -> str:
        """Send the last state."""
        self._broadcaster.publish(self._kind, self.state() | {"state": "ended", "recording": False})
        return Message("{shown} pictures shown", self._shown)

    def at_peak(self) -> dict[str, Any]:
        """For the page after the test: map and gauges at the highest force, without one at the end; the last map."""
        m, last = self._peak, self._newest
        if m is None:
            return {"peak": None, "gauges": [], "points": self.curve.position}
        self._shown += 1
        found: dict[str, Any] = {}
        if last is not None and last is not m:
            self.layers["last"], shown = self.map.draw(last)
            found["last"] = self._shown_after(last, shown, "&layer=last")
        found |= self._response_after(m)
        self.picture, shown = self.map.draw(m)
        words = Message("at the end") if math.isnan(self._peak_N) else Message("at the highest force")
        return found | {
            "peak": self._shown_after(m, shown),
            "atpeak": words,
            "gauges": _gauges(m.time_step, {}, self._colours),
            "points": self.curve.position,
        }

    def _response_after(self, m: Measurement) -> dict[str, Any]:
        """The maps of the whole test that ``strain.h5`` has, over the picture of ``m``."""
        names, found = shown_names(self._config.output.response), dict[str, Any]()
        if self._running is None or not names:
            return found
        try:
            maps = whole_maps(self._running.folder / STRAIN)
        except DataError:  # which the end of the run has told
            return found
        self.map.response = lambda: maps
        for name in (name for name in names if name in maps):
            self.layers[name], shown = self.map.draw(m, name)
            found[name] = self._shown_after(m, shown, f"&layer={name}")
        return found | {"whole": [*found]}

    def _shown_after(self, m: Measurement, shown: dict[str, Any], layer: str = "") -> dict[str, Any]:
        address = f"/picture?side={self._side}&after={self._shown}{layer}"
        return shown | {"picture": address, "s": max(m.time_step.t - self._start_t, 0.0)}

    # -- messages to the page -----------------------------------------------------------------

    def _shown_event(self, event: Event, count: int) -> dict[str, Any]:
        text, s = counted_text(event.text, count), max(event.t - self._start_t, 0.0)
        return {"s": s, "level": event.level, "kind": str(event.kind), "text": text}

    def state(self) -> dict[str, Any]:
        """The state of the run, as the page shows it."""
        running, now = self._running, self._now()
        elapsed_s = now - self._start_t
        s = Snapshot(now, elapsed_s=elapsed_s) if running is None else self._snapshot(running, now)
        values: dict[str, Any] = {
            "side": self._side,
            "state": self._state_name(s),
            "elapsed_s": s.elapsed_s,
            "recording": None if running is None else running.recording,
            "figures": {name: self._figure(s, name) for name in (FORCE, STRESS, AXIAL)},
            "troubles": [printable(text) for text in s.troubles],
            "peak_N": s.peak_N,
            "strain_rate": self._rate if s.figure(BURST).known else None,
            "elongation": self._elongation(s),
            "points": self.curve.position,
            "picture": {
                "n": self._shown,
                "of": self.map.choice.name,
                "range": self.map.choice.span,
                **self._scale,
            },
            "events": [self._shown_event(*one) for one in [*self._events][-MAX_EVENTS:]],
            "facts": [fact(row) for row in s.rows("page")],
            "sides": None if self._cameras is None else self._cameras.state(),
        }
        return values | _measured(s, self._colours)

    def _snapshot(self, running: LiveRun | CameraRun, now: float) -> Snapshot:
        """The state of the test; of a recording all figures are of one instant, and nothing is late."""
        if running.live or self._matched is None or running.run_state.health.ended:
            return running.run_state.snapshot(now)
        s = running.run_state.snapshot(now, self._matched.time_step)
        return replace(s, peak_N=self._peak_N, latency_p95_s=math.nan)

    def _figure(self, s: Snapshot, name: str) -> dict[str, Any]:
        figure = s.figure(name)
        limit = self._limits.of(name, figure.value, s.axial_name)
        if limit is None and name == FORCE and self._running is not None:
            limit = self._limits.of_range(figure.value, self._running.run_state.health.load_range_N)
        return shown(figure) | {"limit": limit}

    def _elongation(self, s: Snapshot) -> Amount | None:
        if self._length_mm is None:
            return None
        name, length_m = f"gauge_{self._elongation_gauge}", 1e-3 * self._length_mm
        strain = s.figure(name if name in s.figures else AXIAL)
        sigma = math.hypot(strain.sigma, self._length_share * strain.value)
        return Amount("length", length_m * strain.value, length_m * sigma)

    def _state_name(self, s: Snapshot) -> str:
        if self._running is None:
            return "opening"
        if self._side and self._running.run_state.health.camera_ended:
            return "ended"  # others go on
        if s.time_step is None:
            return "reference"
        return "paused" if self._running.paused else "measuring"

    def _draw(self) -> None:
        self._fresh = False
        m, frame = self._newest, self._frame
        if m is not None:
            self.picture, self.layers["map"], self._scale = self.map.layers(m)
        elif frame is not None:
            height, width = frame.image.shape
            self.picture = as_jpeg(shrunk(frame.image, frame.bits)[0])
            shapes = gauge_shapes(self._config) | plate_shapes(self._config)
            self._scale = {"width": width, "height": height, "gauges": shapes}
        self._shown += 1


def elongation_length(config: Config) -> tuple[str, float | None, float]:
    """The gauge whose strain over its length is the elongation, "" for the axial strain; the length, mm.

    Last, the relative standard uncertainty of the length, which is that of the scale.

    The line ``axial``, else the first ``extension``, where the scale is known; else the axial strain over the gauge
    length as given.
    """
    if px_per_mm := config.scale.px_per_mm:
        share = (config.scale.sigma_mm_per_px or 0.0) * px_per_mm
        gauges = list(complete_gauges(config.gauges, config.specimen.first_axis))
        for gauge in gauges:
            if isinstance(gauge, LineGauge) and gauge.name == AXIAL:
                return gauge.name, math.dist(gauge.start, gauge.end) / px_per_mm, share
        for gauge in gauges:
            if isinstance(gauge, ExtensionGauge):
                return gauge.name, gauge.length / px_per_mm, share
    return "", config.specimen.gauge_length_mm, 0.0


def shown(figure: TimedFigure) -> dict[str, Any]:
    """A figure as the page draws it; ``value`` is null unless it is live, and then ``last`` is shown with its age."""
    return {
        "state": str(figure.state), "value": figure.value, "last": figure.last, "age_s": figure.age, "why": figure.why,
        "sigma": figure.sigma,
    }  # fmt: skip


def fact(row: ShownFigure) -> dict[str, Any]:
    """A small figure as the page writes it."""
    said = row.figure.said
    return {"label": said, "amount": row.amount, "matters": row.matters, "why": row.now.trouble(said)}


def _gauges(
    step: TimeStep, figures: Mapping[str, TimedFigure], colours: Mapping[str, int]
) -> list[dict[str, Any]]:
    """The gauges of a time step, without the values of those whose figure is not live."""
    found = []
    for name, gauge in step.gauges.items():
        figure = figures.get(f"gauge_{name}", TimedFigure(gauge.value, gauge.sigma))
        part, reason = share_text(gauge.share), gauge.reason
        found.append(
            {
                "name": name, "value": figure.value, "sigma": figure.sigma, "reason": reason, "part": part,
                "colour": colours.get(name),
            }
        )  # fmt: skip
    return found


def _measured(s: Snapshot, colours: Mapping[str, int]) -> dict[str, Any]:
    i = s.time_step
    if i is None:
        return {}
    return {
        "axial": {
            "name": s.axial_name,
            "assumed": Message("axis assumed") if s.axis_assumed else "",
        },
        "gauges": _gauges(i, s.figures, colours),
        "valid": s.valid,
        "zois": s.zois if s.figure(BURST).known else None,
        "part": share_text(s.area_share),
    }
