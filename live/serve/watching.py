"""The page as a consumer of a run: numbers ten times a second, a map four times a second, points as they settle.

The measuring thread only leaves the measurement in a place; everything else is done by the consumer's own
thread, and the map is made only while a page is open.
"""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from acquire.events import Event, EventKind
from acquire.frame import Frame
from acquire.load_sample import LoadSample
from acquire.printable import printable
from live.maps import FIELD_MAPS, FieldMaps, Painted, lay_cells
from live.measure import AxisFinder, Instant, Measurement
from live.outputs import Consumer, Policy
from live.serve.curve import Curve
from live.serve.painting import as_jpeg, shrunk
from live.serve.web import Hub
from live.setup import Config, complete_gauges
from live.tell import Books, sentence

STATE_S, PICTURE_S = 0.1, 0.25
"""Between states and between pictures."""
MOST_EVENTS = 30
_LATENCIES = 100


class Running(Protocol):
    """What is asked of a run."""

    @property
    def paused(self) -> bool: ...

    @property
    def recording(self) -> bool: ...

    @property
    def books(self) -> Books: ...

    @property
    def folder(self) -> Path: ...

    @property
    def fps(self) -> float: ...


class Watching(Consumer):
    """Tells the pages how a run stands.

    Parameters
    ----------
    hub : Hub
    config : Config
    now : callable giving monotonic seconds

    Attributes
    ----------
    picture : bytes
        The newest picture with its map, a JPEG.
    curve : Curve
    """

    name = "page"
    policy = Policy.NEWEST
    patience_s = 5.0

    def __init__(self, hub: Hub, config: Config, now: Callable[[], float] = time.monotonic) -> None:
        self._hub, self._config, self._now = hub, config, now
        self._finder = AxisFinder(config.specimen.axis)
        self._component = f"e{self._finder.axis * 2}"
        self._maps = FieldMaps(self._finder.axis, config.view.strain_range)
        names = list(config.gauges) or ["exx", "eyy", "exy"]
        self.curve = Curve(["t", "stress" if config.specimen.area_m2 else "force", "axial", *names])
        self._names = names
        self.picture = b""
        self._shown = 0
        self._scale: dict[str, Any] = {}
        self._running: Running | None = None
        self._newest: Measurement | None = None
        self._frame: Frame | None = None
        self._fresh = False
        self._force, self._peak = math.nan, math.nan
        self._events: deque[tuple[float, dict[str, Any]]] = deque(maxlen=MOST_EVENTS)
        self._late: deque[float] = deque(maxlen=_LATENCIES)
        self._began = now()
        self._t0 = math.nan
        self._due = {"state": 0.0, "picture": 0.0}
        self._stopped = threading.Event()

    def attend(self, running: Running) -> None:
        """The run has begun, and can be asked."""
        self._running, self._began = running, self._now()

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
        self._late.append(measurement.instant.latency_s)

    def settled(self, measurement: Measurement) -> None:
        """A point of the curves."""
        i = measurement.instant
        if math.isnan(self._t0):
            self._t0 = i.t
        axial, _ = axial_of(i, self._finder.add(i))
        gauges = [
            i.gauges[name].value if name in i.gauges else getattr(i, name, math.nan) for name in self._names
        ]
        self.curve.add([i.t - self._t0, i.force / (self._config.specimen.area_m2 or 1.0), axial, *gauges])

    def frame(self, frame: Frame) -> None:
        """Keep the newest, to be shown until something is measured."""
        if self._newest is None and not frame.damaged:
            self._frame, self._fresh = frame, True

    def load(self, sample: LoadSample) -> None:
        """Keep the newest and the largest."""
        self._force = sample.force
        if not abs(sample.force) <= abs(self._peak):
            self._peak = sample.force if math.isfinite(sample.force) else self._peak

    def event(self, event: Event) -> None:
        """Keep the last ones."""
        if event.kind is EventKind.MEASURED:
            return
        names = {} if self._running is None else self._running.books.journal.names
        text = printable(sentence(event, names))
        told = {"level": event.level, "kind": str(event.kind), "text": text}
        self._events.append((self._now(), told))

    def idle(self) -> float:
        """Tell and draw what is due."""
        now = self._now()
        if now >= self._due["state"]:
            self._due["state"] = now + STATE_S
            self._hub.tell("run", self.state())
        if now >= self._due["picture"] and self._fresh and self._hub.watched:
            self._draw()
            # No more than a fifth of the time is spent on drawing, however large the pictures are.
            self._due["picture"] = max(now + PICTURE_S, self._now() + 4 * (self._now() - now))
        return STATE_S

    def end(self) -> str:
        """A last word to the pages."""
        self._hub.tell("run", self.state() | {"state": "ended"})
        return f"{self._shown} pictures shown"

    # -- what is told -------------------------------------------------------------------------

    def state(self) -> dict[str, Any]:
        """Where the run stands."""
        specimen, running = self._config.specimen, self._running
        area = specimen.area_m2
        told: dict[str, Any] = {
            "state": self._word(),
            "elapsed_s": self._now() - self._began,
            "force_N": self._force,
            "peak_N": self._peak,
            "stress_Pa": self._force / area if area else None,
            "points": self.curve.place,
            "picture": {"n": self._shown, "of": self._component, **self._scale},
            "events": [{"s": max(at - self._began, 0.0), **event} for at, event in self._events],
            "late_s": _p95(self._late),
        }
        if self._newest is not None:
            told |= _measured(self._newest.instant, self._finder.axis)
        if running is not None:
            told |= {
                "fps": running.fps,
                "ledger": running.books.ledger.as_dict(),
                "recording": running.recording,
                "alarms": [printable(text) for text in running.books.alarms.texts],
                "disk_min": running.books.vitals.disk_s / 60,
                "folder": str(running.folder),
            }
        return told

    def _word(self) -> str:
        if self._running is None:
            return "opening"
        if self._newest is None:
            return "reference"
        return "paused" if self._running.paused else "measuring"

    def _draw(self) -> None:
        self._fresh = False
        m, frame = self._newest, self._frame
        if m is not None:
            picture, scale = shrunk(m.burst.mean, m.burst.bits)
            painted = self._maps.paint(m.field, (self._component,))[self._component]
            lay_cells(picture, scale, m.field.grid, painted.rgba, (m.instant.u, m.instant.v))
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


def axial_of(i: Instant, axis: str) -> tuple[float, float]:
    """Strain along the load and its sigma: the gauge called axial, or else the mean."""
    gauge = i.gauges.get("axial")
    if gauge is not None:
        return gauge.value, gauge.sigma
    return (i.exx, i.sigma_exx) if axis == "x" else (i.eyy, i.sigma_eyy)


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


def _measured(i: Instant, axis: str) -> dict[str, Any]:
    value, sigma = axial_of(i, axis)
    gauges = [
        {"name": name, "value": gauge.value, "sigma": gauge.sigma, "reason": gauge.reason}
        for name, gauge in i.gauges.items()
    ]
    named = "axial" if "axial" in i.gauges else ("exx" if axis == "x" else "eyy")
    return {
        "axial": {"name": named, "value": value, "sigma": sigma},
        "gauges": gauges,
        "valid": i.n_valid,
        "zois": i.n_zoi,
        "refused": i.refused,
        "kernel_s": i.measure_s,
    }


def _p95(late: deque[float]) -> float:
    known = [value for value in late if math.isfinite(value)]
    return float(np.percentile(known, 95)) if known else math.nan
