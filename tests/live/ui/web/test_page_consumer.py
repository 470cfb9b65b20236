"""The page as a consumer: its messages and its cost for the measurement; and the translations of the page."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import cv2
import numpy as np
import pytest

from acquire.events import Event, EventKind
from acquire.load_sample import LoadSample
from acquire.text import Message
from analysis import StrainField
from analysis.evaluate import GaugeValue
from live.config.loading import Config, load_config
from live.pipeline.consumer import Consumer
from live.pipeline.measurement import Measurement
from live.stream.adapted import Adapted
from live.ui.web.broadcaster import Broadcaster, plain
from live.ui.web.map_view import RED, MapView, mark_saturated, plate_shapes, shrunk, traffic_light
from live.ui.web.page_consumer import PageConsumer, elongation_length
from live.ui.web.run_panels import MAX_POINTS, CurveHistory
from tests.live.streaming import record_of
from tests.live.ui.web.page_texts import STATIC
from tests.live.ui.web.test_page_values import Run, pictured

COLOURS = [("left", 3), ("right", 1)]


@pytest.fixture
def config() -> Config:
    return load_config(None, {"specimen.area_mm2": 40.0})


def ready(consumer: PageConsumer) -> PageConsumer:
    consumer.begin()
    return consumer


def test_the_state_of_a_run(config: Config) -> None:
    run, consumer = (
        Run(config, state="REC", began_t=0.0),
        ready(PageConsumer(Broadcaster(), config, lambda: 1.5)),
    )
    consumer.attach(run)
    m = pictured()
    i = replace(
        m.time_step,
        gauges={"axial": GaugeValue(0.001, 2e-6, share=0.83), "b": GaugeValue(math.nan, math.nan, "lost")},
    )
    consumer.measurement(replace(m, time_step=i))
    run.run_state.history.add(i)
    for t, force in enumerate((500.0, -400.0)):
        run.run_state.loads.append(LoadSample(t, force))
        run.run_state.health.loaded(t, force)
    consumer.event(Event(0.0, EventKind.DEVICE, "camera", "a \x1b[31mfault", "error"))
    state = plain(consumer.state())
    assert state["peak_N"] == 500 and state["axial"] == {"name": "axial", "assumed": ""}
    found = {name: (one["value"], one["sigma"]) for name, one in state["figures"].items()}
    assert found == {"force": (-400, None), "stress": (pytest.approx(-1e7), None), "axial": (0.001, 2e-6)}
    lost = {"name": "b", "value": None, "sigma": None, "reason": "lost", "part": "", "colour": None}
    assert state["gauges"][1] == lost
    assert state["part"] == state["gauges"][0]["part"] == Message("of {share} % of the area", 83).to_json()
    assert state["events"][0]["level"] == "error" and "\x1b" not in state["events"][0]["text"]
    for k in range(4555):
        consumer.event(Event(0.0, EventKind.ALARM, "alarm", f"force is {k} N", "warning"))
    shown = consumer.state()["events"]
    assert len(shown) == 5 and shown[-1]["text"] == "alarm: force is 4554 N (4\u202f555 times)"


def test_the_map_is_drawn_only_while_a_page_is_open(config: Config) -> None:
    broadcaster = Broadcaster()
    consumer = ready(PageConsumer(broadcaster, config))
    consumer.measurement(pictured())
    consumer.idle()
    assert consumer.picture == b""
    broadcaster.open()
    consumer.idle()
    m = pictured()
    picture = cv2.imdecode(np.frombuffer(consumer.picture, np.uint8), cv2.IMREAD_COLOR)
    assert picture.shape[:2] == m.burst.mean.shape


def test_another_map(config: Config) -> None:
    broadcaster = Broadcaster()
    broadcaster.open()
    consumer = ready(PageConsumer(broadcaster, config))
    for name in ("exx", "e1", "u", "sigma", "status"):
        consumer.measurement(pictured())
        assert consumer.select_map({"of": name}) == ""
        before = consumer.state()["picture"]["n"]
        while consumer.state()["picture"]["n"] == before:
            consumer.idle()
    assert "there is no map" in consumer.select_map({"of": "exx; rm"})
    assert "ranges of a map" in consumer.select_map({"of": "exx", "range": "wide"})
    for limit in (None, "1", True, 0.0, math.inf):
        assert "a fixed range" in consumer.select_map({"of": "exx", "range": "fixed", "limit": limit})


def test_points_are_bounded_and_a_page_gets_what_it_lacks() -> None:
    curve = CurveHistory(["t", "x"])
    for n in range(10):
        curve.add([n, n])
    since = {"names": ["t", "x"], "colours": [], "edition": 0}
    assert curve.since(0, 7) == since | {"first": 7, "rows": [[7, 7], [8, 8], [9, 9]]}
    assert curve.since(1, 7) == since | {"first": 0, "rows": [[n, n] for n in range(10)]}, (
        "of another edition"
    )
    for n in range(10, 5 * MAX_POINTS):
        curve.add([n, n])
    edition, count = curve.position
    assert edition > 0 and count < MAX_POINTS
    anew = curve.since(0, 7)
    times = [row[0] for row in anew["rows"]]
    assert anew["first"] == 0 and len(times) == count
    assert times[0] == 0 and len(set(np.diff(times))) == 1 and times[-1] > 5 * MAX_POINTS - 20


def test_a_failing_page_is_one_consumer_that_failed(config: Config) -> None:
    class Broken(PageConsumer):
        def measurement(self, measurement: Measurement) -> None:
            raise RuntimeError("no")

    told: list[tuple[str, str, bool]] = []
    worker = Adapted(Broken(Broadcaster(), config), lambda *said: told.append(said))
    worker.start()
    worker.take(record_of(pictured()))
    report = worker.end()
    assert report.failed and told[0][2] is False
    assert isinstance(Broken(Broadcaster(), config), Consumer)


def test_the_value_is_that_of_the_zoi_that_has_moved_to_the_place(config: Config) -> None:
    m = pictured()
    grid = m.field.grid
    x, y = np.meshgrid(grid.x, grid.y)
    field = StrainField.from_values(grid, {"dv_dy": 1e-5 * x + 3e-7 * y}, 1e-5)
    view = MapView(config)
    assert view.value_at(1, 1) == {"value": None, "status": "no ZOI is here"}, "nothing is drawn yet"
    view.draw(replace(m, field=field, time_step=replace(m.time_step, u=20.0, v=-13.0)))
    for row, column in ((1, 2), (3, 4)):
        found = view.value_at(grid.x[column] + 20.0 + 5, grid.y[row] - 13.0 - 5)
        assert found["value"] == pytest.approx(1e-5 * grid.x[column] + 3e-7 * grid.y[row])
        assert found["sigma"] == pytest.approx(field.sigma("eyy")[row, column])
    for off, there in ((7.9, True), (8.1, False)):  # half a step beyond the last centre
        assert (view.value_at(grid.x[-1] + 20.0 + off, grid.y[2] - 13.0)["value"] is not None) == there


def test_a_map_that_is_chosen_while_another_is_drawn_is_the_next_one(config: Config) -> None:
    view, m = MapView(config), pictured()
    paint = view._maps.paint

    def painted(*given: Any) -> Any:
        assert not view.choose("status", "automatic", None)
        return paint(*given)

    view._maps.paint = painted  # type: ignore[method-assign]
    assert view.layers(m)[2]["of"] == "eyy"
    read = [view.value_at(float(x), float(y)) for x in m.field.grid.x for y in m.field.grid.y]
    assert any(one.get("sigma") is not None for one in read), (
        "what is read is eyy with its sigma, not a status"
    )
    assert view.layers(m)[2]["of"] == "status"


def test_a_map_of_the_whole_test_has_its_value_with_sigma_and_unit() -> None:
    """And nothing before there is one."""
    config, m = load_config(None, {"specimen.area_mm2": 40.0, "output.response": "stress"}), pictured()
    view, grid = MapView(config), m.field.grid
    assert "compliance" in MapView(load_config(None, {})).choose("compliance", "automatic", None)
    assert view.choose("compliance", "automatic", None) == ""
    x, y = (float(c[2]) + moved for c, moved in ((grid.x, m.time_step.u), (grid.y, m.time_step.v)))
    assert view.layers(m)[2]["of"] == "compliance" and view.value_at(x, y)["value"] is None
    of_place = 14e-12 + 1e-13 * np.indices(grid.shape)[1]
    view.response = lambda: {"compliance": of_place, "sigma_compliance": np.full(grid.shape, 2.5e-13)}
    shown = view.layers(m)[2]
    assert (shown["unit"], shown["strain"]) == ("µm/m/MPa", False) and sum(shown["histogram"]) == grid.shape[
        0
    ] * grid.shape[1]
    assert 13 < shown["low"] <= 14 and 14.6 <= shown["high"] < 16
    read = view.value_at(x, y)
    assert (read["value"], read["sigma"]) == (pytest.approx(14.2), pytest.approx(0.25))


def test_a_recording_shows_figures_of_one_instant(config: Config) -> None:
    """Its load samples come far ahead of its pictures: the newest force is of another instant."""
    broadcaster, run = Broadcaster(), Run(config, state="REC", began_t=0.0)
    run.live = False  # type: ignore[misc]
    consumer = ready(PageConsumer(broadcaster, config))
    consumer.attach(run)  # type: ignore[arg-type]
    run.run_state.health.recorded = True
    m = pictured()
    m = replace(m, time_step=replace(m.time_step, force=1234.0, latency_s=3.0))
    run.run_state.loads.append(LoadSample(1e3, -9999.0))
    run.run_state.health.loaded(1e3, -9999.0)
    run.run_state.health.latency_p95_s = 3.0
    run.run_state.history.add(m.time_step)
    consumer.matched(m)
    state = consumer.state()
    force, stress = (state["figures"][name]["value"] for name in ("force", "stress"))
    assert force == state["peak_N"] == 1234.0 and stress == pytest.approx(1234 / 40e-6)
    assert "delay" not in {one["label"] for one in state["facts"]}
    assert consumer.curve.since(0, 0)["rows"][-1][1] == pytest.approx(stress)


def test_a_gauge_has_its_stored_colour_and_the_force_the_range_of_its_cell() -> None:
    """The colours of the map are those of lists and curves, also where a gauge before was removed."""
    gauges = {
        f"gauges.{name}": {"kind": "line", "start": [1, 2], "end": [3, 40], "colour": k}
        for name, k in COLOURS
    }
    config = load_config(None, {"specimen.area_mm2": 40.0, **gauges})
    run, consumer = (
        Run(config, state="REC", began_t=0.0),
        ready(PageConsumer(Broadcaster(), config, lambda: 0.5)),
    )
    consumer.attach(run)  # type: ignore[arg-type]
    m = pictured()
    m = replace(
        m, time_step=replace(m.time_step, gauges={name: GaugeValue(0.001, 2e-6) for name, _ in COLOURS})
    )
    consumer.matched(m)
    run.run_state.history.add(m.time_step)
    run.run_state.loads.append(LoadSample(0.4, -8000.0))
    run.run_state.health.loaded(0.4, -8000.0)
    assert [(one["name"], one["colour"]) for one in consumer.state()["gauges"]] == COLOURS
    assert [(one["name"], one["colour"]) for one in consumer.at_peak()["gauges"]] == COLOURS
    assert consumer.curve.since(0, 0)["colours"] == [k for _, k in COLOURS]
    assert consumer.state()["figures"]["force"]["limit"] is None, "the range is not known"
    run.run_state.health.load_range_N = 10e3
    limit = consumer.state()["figures"]["force"]["limit"]
    assert (limit["share"], limit["value"], limit["range"], limit["near"]) == (0.8, 10e3, True, False)


def test_the_length_of_an_elongation() -> None:
    line = {"gauges.axial": {"kind": "line", "start": [10, 20], "end": [10, 120]}}
    strips = {"gauges.whole": {"kind": "extension", "box": [10, 20, 60, 120], "along": "y"}}
    given, scale = {"specimen.gauge_length_mm": 50.0}, {"scale.mm_per_px": 0.1}
    assert elongation_length(load_config(None, {**strips, **line, **scale})) == (
        "axial",
        pytest.approx(10.0),
        0,
    )
    # Between the middles of the first and the last sixth.
    assert elongation_length(load_config(None, {**strips, **scale})) == ("whole", pytest.approx(10.0), 0)
    assert elongation_length(load_config(None, line | given)) == ("", 50.0, 0)
    assert elongation_length(load_config(None, line)) == ("", None, 0)


def test_the_library_has_its_licence_and_origin() -> None:
    text = (STATIC / "uplot-license.txt").read_text("utf-8")
    assert "The MIT License" in text and "https://github.com/leeoniya/uPlot" in text and "1.6.32" in text


def test_plates_are_drawn_beside_the_gauges_and_cannot_be_dragged() -> None:
    plates = {"plate.left": {"box": [10, 20, 30, 40]}}
    config = load_config(None, {"gauges.axial": {"kind": "line", "start": [1, 2], "end": [3, 4]}, **plates})
    shapes = plate_shapes(config)
    assert shapes == {
        "plate left": {
            "kind": "plate",
            "handles": [(10, 20)],
            "outline": [[(10, 20), (40, 20), (40, 60), (10, 60), (10, 20)]],
        }
    }
    broadcaster = Broadcaster()
    broadcaster.open()
    consumer = ready(PageConsumer(broadcaster, config))
    consumer.measurement(pictured())
    consumer.idle()
    assert set(consumer.state()["picture"]["gauges"]) == {"axial", "plate left"}


def test_the_noise_of_zois_from_green_over_yellow_to_red() -> None:
    """By its logarithm: yellow is at the geometric mean of the two limits."""
    noise = np.array([0.5e-4, 1e-4, 3e-4, 9e-4, 5e-3, np.nan])
    colours = traffic_light(noise, 1e-4, 9e-4)
    green, yellow, red = (40, 170, 80), (240, 200, 30), (220, 50, 40)
    wanted = np.array([green, green, yellow, red, red, red])
    assert np.abs(colours[:, :3].astype(int) - wanted).max() <= 1


def test_a_large_picture_is_reduced_and_its_grey_levels_fill_those_of_the_screen() -> None:
    image = np.full((600, 1920), 1023, np.uint16)
    image[:, 960:] = 512
    picture, scale = shrunk(image, 10)
    assert (picture.shape, scale) == ((300, 960, 3), 0.5)
    assert (picture[:, :470] == 255).all() and (picture[:, 490:] == 127).all()


def test_a_single_saturated_pixel_is_red_in_a_reduced_picture() -> None:
    image = np.zeros((40, 60), np.uint16)
    image[39, 59], image[10, 31], image[20, 8] = 4095, 4080, 4079
    picture, scale = shrunk(image, 12, 30)
    mark_saturated(picture, scale, image, 4080)
    assert np.argwhere((picture == RED).all(axis=2)).tolist() == [[5, 15], [19, 29]]
