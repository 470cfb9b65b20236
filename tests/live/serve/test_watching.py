"""The page as a consumer: what it tells, and that it costs the measurement next to nothing."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from acquire.events import Event, EventKind
from acquire.load_sample import LoadSample
from analysis.evaluate import GaugeValue
from live.measure import Measurement
from live.outputs import Consumer
from live.outputs.worker import Worker
from live.serve.curve import MOST_POINTS, Curve
from live.serve.watching import Watching
from live.serve.web import Hub
from live.setup import Config, load_config
from live.tell import Books
from tests.live.made_up import make_frame, make_measurement


def measurement() -> Measurement:
    m = make_measurement(0)
    return replace(m, burst=replace(m.burst, mean=make_frame(0, 0.0).image))


class Told:
    """The newest of each kind that a page was told."""

    def __init__(self, hub: Hub) -> None:
        stream = hub.open()
        assert stream is not None
        self._stream = stream

    def __getitem__(self, kind: str) -> object:
        taken = self._stream.take(0)
        assert taken is not None
        return json.loads(taken[kind])


@pytest.fixture
def config() -> Config:
    return load_config(None, {"specimen.area_mm2": 40.0})


class Run:
    """A run that is asked how it stands."""

    paused, recording, folder = False, True, Path("run")

    def __init__(self, config: Config) -> None:
        self.books = Books.new(1.0, specimen=config.specimen)
        self.books.vitals.state, self.books.vitals.began_t = "REC", 0.0


def ready(watching: Watching) -> Watching:
    watching.begin()
    return watching


def test_what_is_told(config: Config) -> None:
    hub, run = Hub(), Run(config)
    told, watching = Told(hub), ready(Watching(hub, config))
    watching.attend(run)
    m = measurement()
    i = replace(
        m.instant, gauges={"axial": GaugeValue(0.001, 2e-6), "b": GaugeValue(math.nan, math.nan, "lost")}
    )
    watching.measurement(replace(m, instant=i))
    run.books.history.add(i)
    for t, force in enumerate((500.0, -400.0)):
        run.books.loads.append(LoadSample(t, force))
        run.books.vitals.loaded(t, force)
    watching.event(Event(0.0, EventKind.DEVICE, "camera", "a \x1b[31mfault", "error"))
    watching.idle()
    state = told["run"]
    assert isinstance(state, dict)
    assert state["force_N"] == -400 and state["peak_N"] == 500 and state["stress_Pa"] == pytest.approx(-1e7)
    assert state["axial"] == {"name": "axial", "value": 0.001, "sigma": 2e-6}
    assert state["gauges"][1] == {"name": "b", "value": None, "sigma": None, "reason": "lost"}
    assert state["events"][0]["level"] == "error" and "\x1b" not in state["events"][0]["text"]


def test_the_map_is_made_only_while_somebody_looks(config: Config) -> None:
    hub = Hub()
    watching = ready(Watching(hub, config))
    watching.measurement(measurement())
    watching.idle()
    assert watching.picture == b""
    hub.open()
    watching.idle()
    m = measurement()
    picture = cv2.imdecode(np.frombuffer(watching.picture, np.uint8), cv2.IMREAD_COLOR)
    assert picture.shape[:2] == m.burst.mean.shape


def test_another_map(config: Config) -> None:
    hub = Hub()
    hub.open()
    watching = ready(Watching(hub, config))
    for name in ("exx", "e1", "u", "sigma", "status"):
        watching.measurement(measurement())
        assert watching.choose(name) == ""
        before = watching.picture
        while watching.picture == before:
            watching.idle()
    assert "there is no map" in watching.choose("exx; rm")


def test_points_are_bounded_and_a_page_gets_what_it_lacks() -> None:
    curve = Curve(["t", "x"])
    for n in range(10):
        curve.add([n, n])
    assert curve.since(0, 7) == {
        "names": ["t", "x"],
        "edition": 0,
        "first": 7,
        "rows": [[7, 7], [8, 8], [9, 9]],
    }
    for n in range(10, 5 * MOST_POINTS):
        curve.add([n, n])
    edition, count = curve.place
    assert edition > 0 and count < MOST_POINTS
    anew = curve.since(0, 7)
    times = [row[0] for row in anew["rows"]]
    assert anew["first"] == 0 and len(times) == count
    assert times[0] == 0 and len(set(np.diff(times))) == 1 and times[-1] > 5 * MOST_POINTS - 20


@pytest.fixture
def worker(config: Config) -> Iterator[Worker]:
    hub = Hub()
    for _ in range(8):
        assert hub.open() is not None
    worker = Worker(Watching(hub, config), lambda *told: pytest.fail(str(told)))
    worker.start()
    yield worker
    worker.end()


def costs_of(worker: Worker, m: Measurement) -> list[float]:
    """What each of many measurements takes of the thread that gives them, s."""
    costs = []
    for _ in range(200):
        began = time.thread_time()
        worker.give("measurement", m)
        worker.give("settled", m)
        costs.append(time.thread_time() - began)
        time.sleep(0.002)
    return costs


def test_eight_frozen_pages_cost_the_measuring_thread_under_a_millisecond(worker: Worker) -> None:
    """In the time of its own thread: another busy program is not the page's doing."""
    assert np.percentile(costs_of(worker, measurement()), 95) < 1e-3


def test_a_failing_page_is_one_consumer_that_failed(config: Config) -> None:
    class Broken(Watching):
        def measurement(self, measurement: Measurement) -> None:
            raise RuntimeError("no")

    told: list[tuple[str, str, bool]] = []
    worker = Worker(Broken(Hub(), config), lambda *said: told.append(said))
    worker.start()
    worker.give("measurement", measurement())
    report = worker.end()
    assert report.failed and told[0][2] is False
    assert isinstance(Broken(Hub(), config), Consumer)
