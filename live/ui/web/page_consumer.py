"""The page as a consumer of a run: numbers ten times a second, a map four times a second, points as they settle.

The measuring thread only leaves the measurement in a place; everything else is done by the consumer's own
thread, and the map is made only while a page is open.

The points of the curves, bounded: a long test is thinned evenly, and a page then asks for all of it anew.
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
from live.results.maps.painting import lay_cells
from live.ui.web.broadcaster import Broadcaster
from live.ui.web.painting import as_jpeg, shrunk

MOST_POINTS = 4000


class CurveHistory:
    """Rows of numbers by growing time.

    Parameters
    ----------
    names : sequence of str
        Of the columns.
    """

    def __init__(self, names: Sequence[str]) -> None:
        self._names = list(names)
        self._rows: Thinned[Sequence[float]] = Thinned(MOST_POINTS)
        self._lock = threading.Lock()

    def add(self, row: Sequence[float]) -> None:
        """Take a row, or let it go where the curve has become long."""
        with self._lock:
            self._rows.append(row)

    @property
    def place(self) -> tuple[int, int]:
        """Edition (what a page has of another is of no use) and number of rows."""
        with self._lock:
            return self._rows.halvings, len(self._rows.kept)

    def since(self, edition: int, count: int) -> dict[str, Any]:
        """What a page lacks that has ``count`` rows of ``edition``."""
        with self._lock:
            first = count if edition == self._rows.halvings else 0
            return {
                "names": self._names,
                "edition": self._rows.halvings,
                "first": first,
                "rows": self._rows.kept[first:],
            }


STATE_S, PICTURE_S = 0.1, 0.25
"""Between states and between pictures."""
MOST_EVENTS = 30


class Running(Protocol):
    """What is asked of a run."""

    @property
    def paused(self) -> bool: ...

    @property
    def recording(self) -> bool: ...

    @property
    def run_state(self) -> RunState: ...

    @property
    def folder(self) -> Path: ...


class PageConsumer(Consumer):
    """Tells the pages how a run stands.

    Parameters
    ----------
    broadcaster : Broadcaster
    config : Config
    now : callable giving monotonic seconds

    Attributes
    ----------
    picture : bytes
        The newest picture with its map, a JPEG.
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
        self._events: deque[tuple[float, dict[str, Any]]] = deque(maxlen=MOST_EVENTS)
        self._began = now()
        self._t0 = math.nan
        self._due = {"state": 0.0, "picture": 0.0}

    def attend(self, running: Running) -> None:
        """The run has begun, and can be asked."""
        self._running, self._began = running, running.run_state.health.began_t

    def choose(self, component: str) -> str:
        """Show another map; a refusal in words, or empty."""
        if component not in FIELD_MAPS:
            return f"there is no map {component!r}; there are {', '.join(FIELD_MAPS)}"
        self._component, self._fresh = component, True
        return ""

    # -- what a run gives ---------------------------------------------------------------------

    def measurement(self, measurement: Measurement) -> None:
        """Keep the newest."""
        self._newest, self._fresh = measurement, True

    def matched(self, measurement: Measurement) -> None:
        """A point of the curves."""
        i = measurement.time_step
        if math.isnan(self._t0):
            self._t0 = i.t
        axis = (
            self._running.run_state.history.current_axis
            if self._running
            else self._config.specimen.first_axis
        )
        gauges = [
            i.gauges[name].value if name in i.gauges else getattr(i, name, math.nan) for name in self._names
        ]
        stress = i.force / (self._config.specimen.area_m2 or 1.0)
        self.curve.add([i.t - self._t0, stress, i.axial(axis)[0], *gauges])

    def frame(self, frame: Frame) -> None:
        """Keep the newest, to be shown until something is measured."""
        if self._newest is None and not frame.damaged:
            self._frame, self._fresh = frame, True

    def event(self, event: Event) -> None:
        """Keep the last ones."""
        if event.kind is EventKind.MEASURED:
            return
        names = {} if self._running is None else self._running.run_state.event_log.names
        text = printable(sentence(event, names))
        told = {"level": event.level, "kind": str(event.kind), "text": text}
        self._events.append((self._now(), told))

    def idle(self) -> float:
        """Tell and draw what is due."""
        now = self._now()
        if now >= self._due["state"]:
            self._due["state"] = now + STATE_S
            self._broadcaster.tell("run", self.state())
        if now >= self._due["picture"] and self._fresh and self._broadcaster.watched:
            self._draw()
            # No more than a fifth of the time is spent on drawing, however large the pictures are.
            self._due["picture"] = max(now + PICTURE_S, self._now() + 4 * (self._now() - now))
        return STATE_S

    def end(self) -> str:
        """A last word to the pages."""
        self._broadcaster.tell("run", self.state() | {"state": "ended"})
        return f"{self._shown} pictures shown"

    # -- what is told -------------------------------------------------------------------------

    def state(self) -> dict[str, Any]:
        """Where the run stands."""
        running, now = self._running, self._now()
        s = Snapshot(now, elapsed_s=now - self._began) if running is None else running.run_state.snapshot(now)
        told: dict[str, Any] = {
            "state": self._word(s),
            "elapsed_s": s.elapsed_s,
            "force_N": s.force_N,
            "peak_N": s.peak_N,
            "stress_Pa": s.stress_Pa,
            "points": self.curve.place,
            "picture": {"n": self._shown, "of": self._component, **self._scale},
            "events": [{"s": max(at - self._began, 0.0), **event} for at, event in self._events],
            "late_s": s.latency_p95_s,
            "fps": s.fps,
            "ledger": s.frames,
            "alarms": [printable(text) for text in s.alarms],
            "disk_min": s.disk_s / 60,
        }
        if running is not None:
            told |= {"recording": running.recording, "folder": str(running.folder)}
        return told | _measured(s)

    def _word(self, s: Snapshot) -> str:
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
            lay_cells(picture, scale, m.field.grid, painted.rgba, (m.time_step.u, m.time_step.v))
            self._scale = _scale_of(painted)
            size = m.burst.mean.shape
        elif frame is not None:
            picture, scale = shrunk(frame.image, frame.bits)
            size = frame.image.shape
        else:
            return
        self._scale |= {"width": size[1], "height": size[0], "gauges": gauges_of(self._config)}
        self.picture = as_jpeg(picture)
        self._shown += 1


def _scale_of(painted: Painted) -> dict[str, Any]:
    """What the colours of a map stand for, as the page shows it."""
    scale = painted.scale
    if scale is not None:
        return {"low": scale.low, "high": scale.high, "unit": scale.unit}
    legend = [{"text": f"{one.name} {one.count}", "colour": f"rgb{one.rgb}"} for one in painted.legend]
    return {"legend": legend}


def gauges_of(config: Config) -> dict[str, Any]:
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
