"""The page as a consumer: its messages and its cost for the measurement; and the translations of the page."""

from __future__ import annotations

import json
import math
import re
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

import live.ui.web
from acquire.events import Event, EventKind
from acquire.load_sample import LoadSample
from analysis.evaluate import GAUGE_KINDS, GaugeValue
from live.config.loading import Config, load_config
from live.pipeline.consumer import Consumer
from live.pipeline.consumer_thread import ConsumerThread
from live.pipeline.measurement import Measurement
from live.pipeline.run_state import RunState
from live.results.maps.field_maps import FIELD_MAPS
from live.ui.web.broadcaster import Broadcaster
from live.ui.web.page_consumer import MAX_POINTS, CurveHistory, PageConsumer
from tests.live.made_up import make_frame, make_measurement


def measurement() -> Measurement:
    m = make_measurement(0)
    return replace(m, burst=replace(m.burst, mean=make_frame(0, 0.0).image))


class Received:
    """The newest message of each kind that a page received."""

    def __init__(self, broadcaster: Broadcaster) -> None:
        stream = broadcaster.open()
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
    """A run with a state."""

    paused, recording, folder = False, True, Path("run")

    def __init__(self, config: Config) -> None:
        self.run_state = RunState.new(1.0, specimen=config.specimen)
        self.run_state.health.state, self.run_state.health.began_t = "REC", 0.0


def ready(consumer: PageConsumer) -> PageConsumer:
    consumer.begin()
    return consumer


def test_the_state_of_a_run(config: Config) -> None:
    broadcaster, run = Broadcaster(), Run(config)
    received, consumer = Received(broadcaster), ready(PageConsumer(broadcaster, config))
    consumer.attach(run)
    m = measurement()
    i = replace(
        m.time_step, gauges={"axial": GaugeValue(0.001, 2e-6), "b": GaugeValue(math.nan, math.nan, "lost")}
    )
    consumer.measurement(replace(m, time_step=i))
    run.run_state.history.add(i)
    for t, force in enumerate((500.0, -400.0)):
        run.run_state.loads.append(LoadSample(t, force))
        run.run_state.health.loaded(t, force)
    consumer.event(Event(0.0, EventKind.DEVICE, "camera", "a \x1b[31mfault", "error"))
    consumer.idle()
    state = received["run"]
    assert isinstance(state, dict)
    assert state["force_N"] == -400 and state["peak_N"] == 500 and state["stress_Pa"] == pytest.approx(-1e7)
    assert state["axial"] == {"name": "axial", "value": 0.001, "sigma": 2e-6}
    assert state["gauges"][1] == {"name": "b", "value": None, "sigma": None, "reason": "lost"}
    assert state["events"][0]["level"] == "error" and "\x1b" not in state["events"][0]["text"]


def test_the_map_is_drawn_only_while_a_page_is_open(config: Config) -> None:
    broadcaster = Broadcaster()
    consumer = ready(PageConsumer(broadcaster, config))
    consumer.measurement(measurement())
    consumer.idle()
    assert consumer.picture == b""
    broadcaster.open()
    consumer.idle()
    m = measurement()
    picture = cv2.imdecode(np.frombuffer(consumer.picture, np.uint8), cv2.IMREAD_COLOR)
    assert picture.shape[:2] == m.burst.mean.shape


def test_another_map(config: Config) -> None:
    broadcaster = Broadcaster()
    broadcaster.open()
    consumer = ready(PageConsumer(broadcaster, config))
    for name in ("exx", "e1", "u", "sigma", "status"):
        consumer.measurement(measurement())
        assert consumer.select_map(name) == ""
        before = consumer.picture
        while consumer.picture == before:
            consumer.idle()
    assert "there is no map" in consumer.select_map("exx; rm")


def test_points_are_bounded_and_a_page_gets_what_it_lacks() -> None:
    curve = CurveHistory(["t", "x"])
    for n in range(10):
        curve.add([n, n])
    assert curve.since(0, 7) == {
        "names": ["t", "x"],
        "edition": 0,
        "first": 7,
        "rows": [[7, 7], [8, 8], [9, 9]],
    }
    for n in range(10, 5 * MAX_POINTS):
        curve.add([n, n])
    edition, count = curve.position
    assert edition > 0 and count < MAX_POINTS
    anew = curve.since(0, 7)
    times = [row[0] for row in anew["rows"]]
    assert anew["first"] == 0 and len(times) == count
    assert times[0] == 0 and len(set(np.diff(times))) == 1 and times[-1] > 5 * MAX_POINTS - 20


@pytest.fixture
def worker(config: Config) -> Iterator[ConsumerThread]:
    broadcaster = Broadcaster()
    for _ in range(8):
        assert broadcaster.open() is not None
    worker = ConsumerThread(PageConsumer(broadcaster, config), lambda *told: pytest.fail(str(told)))
    worker.start()
    yield worker
    worker.end()


def costs_of(worker: ConsumerThread, m: Measurement) -> list[float]:
    """Time that each of many measurements takes of the thread that passes it on, s."""
    costs = []
    for _ in range(200):
        began = time.thread_time()
        worker.give("measurement", m)
        worker.give("matched", m)
        costs.append(time.thread_time() - began)
        time.sleep(0.002)
    return costs


@pytest.mark.timed
def test_eight_frozen_pages_cost_the_measuring_thread_under_a_millisecond(worker: ConsumerThread) -> None:
    """In thread time: other busy programs do not count."""
    assert np.percentile(costs_of(worker, measurement()), 95) < 1e-3


def test_a_failing_page_is_one_consumer_that_failed(config: Config) -> None:
    class Broken(PageConsumer):
        def measurement(self, measurement: Measurement) -> None:
            raise RuntimeError("no")

    told: list[tuple[str, str, bool]] = []
    worker = ConsumerThread(Broken(Broadcaster(), config), lambda *said: told.append(said))
    worker.start()
    worker.give("measurement", measurement())
    report = worker.end()
    assert report.failed and told[0][2] is False
    assert isinstance(Broken(Broadcaster(), config), Consumer)


STATIC = Path(live.ui.web.__file__).parent / "static"
SCRIPTS = [
    path for path in STATIC.glob("*.js") if path.name != "uplot.js" and not path.name.startswith("words-")
]


def entries(name: str) -> dict[str, str]:
    lines = re.findall(r'^  "(.+?)": "(.+)",$', (STATIC / f"words-{name}.js").read_text("utf-8"), re.M)
    assert len(lines) == len(dict(lines)), "a text is there twice"
    return dict(lines)


def words() -> set[str]:
    """All translated texts: marked in the page, passed to ``t``, or in a table of texts."""
    html = (STATIC / "index.html").read_text("utf-8")
    found = set(re.findall(r'data-t="(.+?)"', html))
    for path in SCRIPTS:
        text = path.read_text("utf-8")
        found |= set(re.findall(r'\bt\("(.+?)"\)', text)) | set(re.findall(r'dataset\.t = "(.+?)"', text))
        found |= {word for pair in re.findall(r'\bt\(\w+ \? "(.+?)" : "(.+?)"\)', text) for word in pair}
        for table in re.findall(r"const (?:HINTS|LABELS|WORDS|BOARD) = \{(.*?)\};", text, re.S):
            found |= set(re.findall(r': "(.+?)"', table))
        for cells in re.findall(r"const CELLS = \[(.*?)\]", text, re.S):
            found |= set(re.findall(r'"(.+?)"', cells)) - {"ZOIs"}
    return found


@pytest.mark.parametrize("name", ["de", "fr"])
def test_every_text_is_translated(name: str) -> None:
    known = set(entries(name))
    assert not words() - known
    # Names of maps and gauge kinds come from the server; one without a translation stays English.
    served = {*FIELD_MAPS, *(word for kind in GAUGE_KINDS.values() for word in (kind.label, kind.hint))}
    assert not known - words() - served


def test_the_library_has_its_licence_and_origin() -> None:
    text = (STATIC / "uplot-license.txt").read_text("utf-8")
    assert "The MIT License" in text and "https://github.com/leeoniya/uPlot" in text and "1.6.32" in text
