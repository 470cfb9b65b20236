"""The page as a consumer of a run: state ten times a second, a map four times a second, points of the curves.

The measuring thread only stores the measurement; the thread of the consumer does everything else, and draws the
map only while a page is open.
"""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Protocol

from acquire.events import Event, EventKind
from acquire.frame import Frame
from acquire.printable import printable
from live.config.gauges import complete_gauges
from live.config.loading import Config
from live.pipeline.consumer import Consumer, Policy
from live.pipeline.event_log import sentence
from live.pipeline.history import Thinned
from live.pipeline.measurement import Measurement
from live.pipeline.run_state import RunState
from live.pipeline.snapshot import Snapshot
from live.results.maps.field_maps import FIELD_MAPS, FieldMaps, Painted
from live.results.maps.painting import overlay_cells
from live.ui.web.broadcaster import Broadcaster
from live.ui.web.painting import as_jpeg, shrunk

MAX_POINTS, MAX_EVENTS = 4000, 30
STATE_S, PICTURE_S = 0.1, 0.25
"""Between states and between pictures."""


class Running(Protocol):
    """What the page reads of a run."""

    @property
    def paused(self) -> bool: ...

    @property
    def recording(self) -> bool: ...

    @property
    def run_state(self) -> RunState: ...

    @property
    def folder(self) -> Path: ...


class PageConsumer(Consumer):
    """Sends the state of a run to the pages.

    Parameters
    ----------
    broadcaster : Broadcaster
    config : Config
    now : callable giving monotonic seconds

    Attributes
    ----------
    picture : bytes
        The newest picture with its map, as JPEG.
    curve : CurveHistory
    """

    name = "page"
    policy = Policy.NEWEST
    timeout_s = 5.0

    def __init__(
        self, broadcaster: Broadcaster, config: Config, now: Callable[[], float] = time.monotonic
    ) -> None:
        self._broadcaster, self._config, self._now = broadcaster, config, now
        axis = config.specimen.first_axis
        self._component = f"e{axis * 2}"
        self._maps = FieldMaps(axis, config.view.strain_range)
        names = list(config.gauges) or ["exx", "eyy", "exy"]
        self.curve = CurveHistory(["t", "stress" if config.specimen.area_m2 else "force", "axial", *names])
        self._names = names
        self.picture = b""
        self._shown = 0
        self._scale: dict[str, Any] = {}
        self._running: Running | None = None
        self._newest: Measurement | None = None
        self._frame: Frame | None = None
        self._fresh = False
        self._events: deque[tuple[float, dict[str, Any]]] = deque(maxlen=MAX_EVENTS)
        self._start_t = now()
        self._t0 = math.nan
        self._due = {"state": 0.0, "picture": 0.0}

    def attach(self, running: Running) -> None:
        """Use ``running``, which has begun."""
        self._running, self._start_t = running, running.run_state.health.began_t

    def select_map(self, component: str) -> str:
        """Show another map; the reason of a refusal, or empty."""
        if component not in FIELD_MAPS:
            return f"there is no map {component!r}; there are {', '.join(FIELD_MAPS)}"
        self._component, self._fresh = component, True
        return ""

    # -- data of a run ------------------------------------------------------------------------

    def measurement(self, measurement: Measurement) -> None:
        """Keep the newest measurement."""
        self._newest, self._fresh = measurement, True

    def matched(self, measurement: Measurement) -> None:
        """Add a point of the curves."""
        i = measurement.time_step
        if math.isnan(self._t0):
            self._t0 = i.t
        running, first_axis = self._running, self._config.specimen.first_axis
        axis = first_axis if running is None else running.run_state.history.current_axis
        strains = [i.gauges[n].value if n in i.gauges else getattr(i, n, math.nan) for n in self._names]
        stress = i.force / (self._config.specimen.area_m2 or 1.0)
        self.curve.add([i.t - self._t0, stress, i.axial(axis)[0], *strains])

    def frame(self, frame: Frame) -> None:
        """Keep the newest frame, shown until something is measured."""
        if self._newest is None and not frame.damaged:
            self._frame, self._fresh = frame, True

    def event(self, event: Event) -> None:
        """Keep the last events."""
        if event.kind is EventKind.MEASURED:
            return
        names = {} if self._running is None else self._running.run_state.event_log.names
        text = printable(sentence(event, names))
        self._events.append((self._now(), {"level": event.level, "kind": str(event.kind), "text": text}))

    def idle(self) -> float:
        """Send and draw what is due."""
        now = self._now()
        if now >= self._due["state"]:
            self._due["state"] = now + STATE_S
            self._broadcaster.publish("run", self.state())
        if now >= self._due["picture"] and self._fresh and self._broadcaster.open_pages:
            self._draw()
            # Drawing takes at most a fifth of the time, also with large pictures.
            self._due["picture"] = max(now + PICTURE_S, self._now() + 4 * (self._now() - now))
        return STATE_S

    def end(self) -> str:
        """Send the last state."""
        self._broadcaster.publish("run", self.state() | {"state": "ended"})
        return f"{self._shown} pictures shown"

    # -- messages to the page -----------------------------------------------------------------

    def state(self) -> dict[str, Any]:
        """The state of the run, as the page shows it."""
        running, now = self._running, self._now()
        elapsed_s = now - self._start_t
        s = Snapshot(now, elapsed_s=elapsed_s) if running is None else running.run_state.snapshot(now)
        values: dict[str, Any] = {
            "state": self._state_name(s),
            "elapsed_s": s.elapsed_s,
            "force_N": s.force_N,
            "peak_N": s.peak_N,
            "stress_Pa": s.stress_Pa,
            "points": self.curve.position,
            "picture": {"n": self._shown, "of": self._component, **self._scale},
            "events": [{"s": max(at - self._start_t, 0.0), **event} for at, event in self._events],
            "late_s": s.latency_p95_s,
            "fps": s.fps,
            "ledger": s.frames,
            "alarms": [printable(text) for text in s.alarms],
            "disk_min": s.disk_s / 60,
        }
        if running is not None:
            values |= {"recording": running.recording, "folder": str(running.folder)}
        return values | _measured(s)

    def _state_name(self, s: Snapshot) -> str:
        if self._running is None:
            return "opening"
        if s.time_step is None:
            return "reference"
        return "paused" if self._running.paused else "measuring"

    def _draw(self) -> None:
        self._fresh = False
        m, frame = self._newest, self._frame
        if m is not None:
            picture, scale = shrunk(m.burst.mean, m.burst.bits)
            painted = self._maps.paint(m.field, (self._component,))[self._component]
            overlay_cells(picture, scale, m.field.grid, painted.rgba, (m.time_step.u, m.time_step.v))
            self._scale = _scale_of(painted)
            size = m.burst.mean.shape
        elif frame is not None:
            picture, scale = shrunk(frame.image, frame.bits)
            size = frame.image.shape
        else:
            return
        self._scale |= {"width": size[1], "height": size[0], "gauges": gauge_shapes(self._config)}
        self.picture = as_jpeg(picture)
        self._shown += 1


class CurveHistory:
    """Rows of numbers by time, bounded: a long test is thinned evenly, and a page then requests all rows again.

    Parameters
    ----------
    names : sequence of str
        Of the columns.
    """

    def __init__(self, names: Sequence[str]) -> None:
        self._names = list(names)
        self._rows: Thinned[Sequence[float]] = Thinned(MAX_POINTS)
        self._lock = threading.Lock()

    def add(self, row: Sequence[float]) -> None:
        """Add a row; a long curve is thinned."""
        with self._lock:
            self._rows.append(row)

    @property
    def position(self) -> tuple[int, int]:
        """Edition (rows of another edition are useless) and number of rows."""
        with self._lock:
            return self._rows.halvings, len(self._rows.kept)

    def since(self, edition: int, count: int) -> dict[str, Any]:
        """The rows that a page with ``count`` rows of ``edition`` lacks."""
        with self._lock:
            first = count if edition == self._rows.halvings else 0
            return {
                "names": self._names,
                "edition": self._rows.halvings,
                "first": first,
                "rows": self._rows.kept[first:],
            }


def _scale_of(painted: Painted) -> dict[str, Any]:
    """The colour scale of a map, as the page shows it."""
    scale = painted.scale
    if scale is not None:
        return {"low": scale.low, "high": scale.high, "unit": scale.unit}
    legend = [{"text": f"{one.name} {one.count}", "colour": f"rgb{one.rgb}"} for one in painted.legend]
    return {"legend": legend}


def gauge_shapes(config: Config) -> dict[str, Any]:
    """The gauges of a configuration as the page draws them: kind, handles and lines, px."""
    found = complete_gauges(config.gauges, config.specimen.first_axis)
    zoi = config.measure.zoi
    return {
        one.name: {
            "kind": one.kind,
            "handles": one.handles(),
            "outline": [[(round(x, 1), round(y, 1)) for x, y in line] for line in one.outline(zoi)],
        }
        for one in found
    }


def _measured(s: Snapshot) -> dict[str, Any]:
    i = s.time_step
    if i is None:
        return {}
    gauges = [
        {"name": name, "value": gauge.value, "sigma": gauge.sigma, "reason": gauge.reason}
        for name, gauge in i.gauges.items()
    ]
    return {
        "axial": {"name": s.axial_name, "value": s.axial, "sigma": s.sigma_axial},
        "gauges": gauges,
        "valid": s.valid,
        "zois": s.zois,
        "refused": i.refused,
        "kernel_s": i.measure_s,
    }
