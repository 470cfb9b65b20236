"""What a page shows of a run: figures and their units, maps, lines over the curve."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from acquire.events import Event, EventKind
from acquire.load_sample import LoadSample
from analysis import StrainField
from analysis.evaluate import GaugeValue
from live.config.loading import Config, load_config
from live.config.sections import SpecimenConfig
from live.pipeline.measurement import Measurement
from live.pipeline.run_state import RunState
from live.results.maps.colours import diverging_table, sequential_table
from live.ui.web.broadcaster import Broadcaster
from live.ui.web.map_view import MapView
from live.ui.web.page_consumer import PageConsumer
from live.ui.web.run_result import peaks, run_result
from tests.live.made_run import E_PA, PULLED, THICKNESS_MM, WIDTH_MM, YIELD, finished, force_of
from tests.live.made_up import START, make_frame, make_grid, make_measurement
from tests.live.screens import StatedRun

LINE = {"gauges.long": {"kind": "line", "start": [64, 20], "end": [64, 70]}}


STRIPS = {"gauges.axial": {"kind": "line", "start": [64, 20], "end": [64, 70]}}


class Run(StatedRun):
    """Begun, with a health that is given."""

    def __init__(self, config: Config, **more: Any) -> None:
        super().__init__(RunState.new(1.0, specimen=config.specimen))
        self.run_state.health.began_t = START
        for name, value in more.items():
            setattr(self.run_state.health, name, value)


def pictured(number: int = 0, strain: float = 1e-3, **more: Any) -> Measurement:
    m = make_measurement(number, strain)
    return replace(
        m, burst=replace(m.burst, mean=make_frame(0, 0.0).image), time_step=replace(m.time_step, **more)
    )


def watched(
    config: Config, now: float = START + 7.5, run: Run | None = None, **more: Any
) -> tuple[PageConsumer, Run]:
    run, broadcaster = run or Run(config), Broadcaster()
    broadcaster.open()
    consumer = PageConsumer(broadcaster, config, lambda: now, **more)
    consumer.attach(run)
    return consumer, run


def test_the_state_counts_from_the_start_in_the_units_of_the_page() -> None:
    config = load_config(None, {"specimen.area_mm2": 40.0})
    consumer, run = watched(config, run=Run(config, disk_s=90 * 60.0, fps=29.5, frame_t=START + 7))
    run.run_state.frame_counts.add(grabbed=9, lost=2)
    run.run_state.alarms.set("limit", "limit: \x1b too much")
    consumer.event(Event(0.0, EventKind.MEASURED, "measurement", "a burst"))
    consumer.event(Event(0.0, EventKind.NOTE, "operator", "a note"))
    state = consumer.state()
    assert (state["elapsed_s"], state["state"], state["recording"]) == (7.5, "reference", True)
    facts = {one["label"]: one["amount"].value for one in state["facts"]}
    assert facts == {"frames/s": 29.5, "recorded": 0, "lost": 2, "disk": 5400.0}
    assert len(state["troubles"]) == 1 and "\x1b" not in state["troubles"][0]
    assert state["events"] == [{"s": 7.5, "level": "info", "kind": "note", "text": "operator: a note"}]
    assert "axial" not in state, "nothing is measured yet"


@pytest.mark.parametrize(("paused", "name"), [(False, "measuring"), (True, "paused")])
def test_what_is_measured(paused: bool, name: str) -> None:
    config = load_config(None, {"specimen.area_mm2": 40.0, "specimen.axis": "y"})
    consumer, run = watched(config)
    assert PageConsumer(Broadcaster(), config).state()["state"] == "opening"
    run.paused = paused  # type: ignore[misc]
    step = pictured(strain=2e-3, measure_s=0.012, area_share=0.5).time_step
    run.run_state.history.add(step)
    state = consumer.state()
    assert state["state"] == name
    axial = state["axial"]
    assert axial == {"name": "eyy", "assumed": ""}
    strain = state["figures"]["axial"]
    assert strain["sigma"] == pytest.approx(step.sigma_eyy)
    assert strain["value"] == pytest.approx(step.eyy)
    assert (state["valid"], state["zois"], state["part"]) == (33, 34, "of 50 % of the area")


SCALE = {"scale.mm_per_px": 0.1, "scale.sigma_mm_per_px": 3e-4}


@pytest.mark.parametrize(
    ("gauges", "found", "mm"),
    [
        (STRIPS | {"scale.mm_per_px": 0.1}, {"axial": GaugeValue(4e-3, 1e-6)}, 50 * 0.1 * 4e-3),
        (STRIPS | SCALE, {"axial": GaugeValue(4e-3, 1e-5)}, 50 * 0.1 * 4e-3),
        (STRIPS | {"scale.mm_per_px": 0.1}, {}, 50 * 0.1 * 1e-3),  # lost: the axial strain
        ({"specimen.gauge_length_mm": 80.0}, {}, 80 * 1e-3),
        (LINE | {"scale.mm_per_px": 0.1}, {"long": GaugeValue(4e-3, 1e-6)}, None),
    ],
)
def test_the_elongation_in_mm(gauges: dict[str, Any], found: dict[str, Any], mm: float | None) -> None:
    config = load_config(None, {**gauges, "specimen.axis": "y"})
    consumer, run = watched(config)
    run.run_state.history.add(replace(pictured().time_step, gauges=found))
    shown = consumer.state()["elongation"]
    assert (shown and shown.value) == (mm and pytest.approx(1e-3 * mm))
    if gauges == STRIPS | SCALE:
        assert shown.sigma == pytest.approx(50 * 0.1e-3 * np.hypot(1e-5, 4e-3 * 0.003))


def test_a_frame_is_shown_until_something_is_measured() -> None:
    config = load_config(None, STRIPS)
    consumer, _ = watched(config)
    consumer.frame(replace(make_frame(0, START), damaged="a fault"))
    consumer.idle()
    assert consumer.picture == b""
    consumer.frame(make_frame(1, START, (48, 64)))
    consumer.idle()
    shown = consumer.state()["picture"]
    assert (shown["n"], shown["width"], shown["height"]) == (1, 64, 48) and set(shown["gauges"]) == {"axial"}
    picture = cv2.imdecode(np.frombuffer(consumer.picture, np.uint8), cv2.IMREAD_COLOR)
    assert picture.shape[:2] == (48, 64) and picture[0, 0].max() < 10 and picture[-1, -1].min() > 245
    consumer.measurement(pictured())
    consumer.frame(make_frame(2, START, (48, 64)))
    consumer._due["picture"] = 0.0
    consumer.idle()
    assert (consumer.state()["picture"]["n"], consumer.state()["picture"]["width"]) == (2, 128)
    assert consumer.end() == "2 pictures shown"


def test_states_and_pictures_are_sent_at_their_rates() -> None:
    now, published, config = [START], list[tuple[float, str]](), load_config(None, {})

    class Watching(Broadcaster):
        def publish(self, kind: str, value: Any) -> None:
            published.append((round(now[0] - START, 3), kind))

    broadcaster = Watching()
    broadcaster.open()
    consumer, pictures = PageConsumer(broadcaster, config, lambda: now[0], side="second"), []
    for k in range(100):
        now[0] = START + k / 100
        consumer.measurement(pictured())
        assert consumer.idle() == 0.1
        pictures.append(consumer._shown)
    assert [kind for _, kind in published] == ["run second"] * 10
    assert pictures[-1] == 4


@pytest.mark.parametrize(("cameras", "rest_s"), [(1, 0.4), (3, 1.4)])
def test_drawing_takes_a_fifth_of_the_time_whatever_the_number_of_cameras(
    monkeypatch: pytest.MonkeyPatch, cameras: int, rest_s: float
) -> None:
    now, drawn, broadcaster = [START], list[float](), Broadcaster()
    broadcaster.open()
    consumer = PageConsumer(broadcaster, load_config(None, {}), lambda: now[0], cameras=cameras)

    def draw() -> None:
        now[0] += 0.1
        drawn.append(now[0])

    monkeypatch.setattr(consumer, "_draw", draw)
    for _ in range(300):
        consumer.measurement(pictured())
        consumer.idle()
        now[0] += 0.01
    gaps = np.diff(drawn) - 0.1
    assert len(gaps) and gaps == pytest.approx(rest_s, abs=0.02)


def test_a_point_of_the_curves_is_si_and_counts_from_the_first() -> None:
    config = load_config(None, {**STRIPS, "specimen.area_mm2": 40.0, "specimen.axis": "y"})
    consumer = PageConsumer(Broadcaster(), config)
    for k, force in enumerate((80.0, -160.0)):
        gauges = {"axial": GaugeValue(5e-3 * (k + 1), 1e-6)}
        consumer.matched(pictured(k, force=force, gauges=gauges, eyy=1e-3))
    found = consumer.curve.since(0, 0)
    assert found["names"] == ["t", "stress", "axial", "axial"]
    assert found["rows"] == [
        pytest.approx([0, 2e6, 5e-3, 5e-3]), pytest.approx([0.1, -4e6, 1e-2, 1e-2], rel=1e-6),
    ]  # fmt: skip
    bare = PageConsumer(Broadcaster(), load_config(None, {"specimen.axis": "x"}))
    bare.matched(pictured(0, force=80.0, exx=1.0, eyy=2.0, exy=3.0))
    assert bare.curve.since(0, 0)["names"] == ["t", "force", "axial", "exx", "eyy", "exy"]
    assert bare.curve.since(0, 0)["rows"] == [[0.0, 80.0, 1.0, 1.0, 2.0, 3.0]]


@pytest.mark.parametrize(
    ("forces", "strain", "words"),
    [((math.nan, math.nan), 2e-3, "at the end"), ((5.0, 5.0), 2e-3, "at the highest force"),
     ((5.0, 4.0), 1e-3, "at the highest force"), ((5.0, math.nan), 1e-3, "at the highest force"),
     ((100.0, -900.0, 500.0), 2e-3, "at the highest force")],
)  # fmt: skip
def test_the_map_after_the_test(forces: tuple[float, ...], strain: float, words: str) -> None:
    consumer = PageConsumer(Broadcaster(), load_config(None, {}), side="front")
    assert consumer.at_peak()["peak"] is None
    for k, force in enumerate(forces):
        gauges = {"axial": GaugeValue(1e-3 * (k + 1), 1e-6)}
        consumer.matched(pictured(k, force=force, gauges=gauges))
    found = consumer.at_peak()
    assert found["atpeak"] == words
    assert [one["value"] for one in found["gauges"]] == [strain]
    assert found["peak"]["picture"] == "/picture?side=front&after=1"


def test_the_map_of_one_camera_or_of_several() -> None:
    config = load_config(None, {})
    sides = {name: PageConsumer(Broadcaster(), config, side=name) for name in ("first", "second", "third")}
    for name, consumer in sides.items():
        consumer.matched(pictured(gauges={f"of {name}": GaugeValue(1e-3, 1e-6)}))
    assert peaks({}) == {} and "cameras" not in peaks({"": sides["first"]})
    found = peaks(sides)
    assert [(one["name"], one["side"]) for one in found["gauges"]] == [
        ("of first", "first"), ("of second", "second"), ("of third", "third"),
    ]  # fmt: skip
    assert [one["side"] for one in found["cameras"]] == ["first", "second", "third"]
    assert [f"side={one['side']}&" in one["peak"]["picture"] for one in found["cameras"]] == [True] * 3


def test_the_map_moves_with_the_specimen() -> None:
    grid = make_grid()
    one = np.zeros(grid.shape)
    one[2, 2] = 0.01
    m = pictured(u=20.0, v=-10.0)
    view = MapView(load_config(None, {"specimen.axis": "y", "view.strain_range": 0.01}))
    content, _ = view.draw(replace(m, field=StrainField.from_values(grid, {"dv_dy": one}, 1e-5)))
    picture = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_COLOR).astype(float)
    rows, columns = np.nonzero(picture[..., 2] - picture[..., 0] > 80)
    assert np.mean(columns) == pytest.approx(grid.x[2] + 20, abs=1.5)
    assert np.mean(rows) == pytest.approx(grid.y[2] - 10, abs=1.5)


@pytest.mark.parametrize(
    ("span", "strains", "is_diverging", "ends"),
    [
        ("automatic", (1e-3, 3e-3), False, (8e-4, 3.2e-3)),
        ("automatic", (-1e-3, 3e-3), True, (-4e-3, 4e-3)),
        ("symmetric", (1e-3, 3e-3), True, (-4e-3, 4e-3)),
        ("fixed", (1e-3, 3e-3), True, (-0.01, 0.01)),
    ],
)
def test_a_map_brings_the_colours_of_its_bar(
    span: str, strains: tuple[float, float], is_diverging: bool, ends: tuple[float, float]
) -> None:
    grid = make_grid()
    eyy = np.linspace(*strains, grid.shape[0])[:, None] * np.ones(grid.shape)
    view = MapView(load_config(None, {"specimen.axis": "y"}))
    assert view.choose("eyy", span, 0.01) == ""
    _, shown = view.draw(replace(pictured(), field=StrainField.from_values(grid, {"dv_dy": eyy}, 1e-6)))
    table = diverging_table() if is_diverging else sequential_table()
    assert shown["diverging"] is is_diverging and len(shown["ramp"]) == 11
    assert [shown["ramp"][0], shown["ramp"][-1]] == [f"#{bytes(table[k]).hex()}" for k in (0, -1)]
    assert (shown["low"], shown["high"]) == pytest.approx(ends, rel=0.05)
    view.choose("sigma", span, 0.01)
    _, shown = view.draw(replace(pictured(), field=StrainField.from_values(grid, {"dv_dy": eyy}, 1e-6)))
    assert not shown["diverging"] and shown["low"] == 0


def test_the_lines_over_the_curve_are_in_si_units() -> None:
    specimen = SpecimenConfig(width_mm=WIDTH_MM, thickness_mm=THICKNESS_MM, axis="y")
    state = RunState.new(1.0, specimen=specimen)
    for k, strain in enumerate(PULLED):
        state.loads.append(LoadSample(START + 0.1 * k, force_of(strain)))
        state.history.add(make_measurement(k, strain).time_step)
    state.loads.close()
    result = run_result(state, finished(state, specimen), Path("runs/a"), "interrupted")
    assert (result["folder"], result["words"]) == (str(Path("runs/a")), "interrupted")
    elastic, offset, proof, highest = result["lines"]
    (x0, y0), (x1, y1) = elastic["points"]
    assert (y1 - y0) / (x1 - x0) == pytest.approx(E_PA, rel=5e-3)
    assert offset["points"][0][0] - x0 == pytest.approx(0.002, rel=1e-6)
    ((strain, stress),) = proof["points"]
    assert proof["words"] == {"name": "Rp0.2", "value": stress, "bound": False}
    assert stress == pytest.approx(E_PA * YIELD, rel=5e-3) and strain == pytest.approx(
        YIELD + 0.002, rel=0.02
    )
    assert (highest["words"]["name"], highest["words"]["bound"]) == ("Rm", True), "the stress never fell"
    assert highest["words"]["value"] == pytest.approx(force_of(PULLED[-1]) / 20e-6, rel=1e-6)
    (e,) = (one for one in result["figures"] if one["name"] == "E")
    assert e["text"].kind == "stress" and e["text"].value == pytest.approx(70e9, rel=5e-3)
