"""What the scene draws, by value: places, units, words and colours of each entity."""

from __future__ import annotations

import itertools
import math
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import cv2
import numpy as np
import pytest

from acquire.events import Event, EventKind
from analysis.field import StrainField
from live.pipeline.snapshot import Snapshot
from live.results.maps.colours import diverging_table, sequential_table
from live.ui.rerun.drawing.layout import (
    BAR_HEIGHT,
    BAR_LABEL,
    BAR_TOP,
    CurveDrawing,
    blueprint,
    force_axis,
    rounded,
    strain_axis,
    stress_axis,
)
from live.ui.rerun.drawing.scene import ViewScene
from live.ui.rerun.drawing.sinks import _columns
from live.ui.rerun.messages import LargeFigures, PictureMessage, ViewSetup
from tests.live.made_up import START, make_grid

pytest.importorskip("rerun")


class Sink:
    """Takes everything, and keeps it by entity."""

    def __init__(self) -> None:
        self.stream = self
        self.logged: dict[str, list[Any]] = defaultdict(list)
        self.rows: dict[str, list[Sequence[float]]] = defaultdict(list)
        self.times: list[float] = []
        self.bytes = 0

    def takes(self, kind: str, t: float) -> bool:
        return True

    def set_time(self, name: str, duration: float) -> None:
        assert name == "time"
        self.times.append(duration)

    def log(self, path: str, archetype: Any, static: bool = False) -> None:
        self.logged[path].append(archetype)

    def count(self, data: bytes) -> None:
        self.bytes += len(data)

    def add_row(self, path: str, row: Sequence[float]) -> None:
        self.rows[path].append(row)

    def send_rows(self) -> None: ...

    def needs_curves_again(self) -> bool:
        return False

    def last(self, path: str, component: str) -> Any:
        """The values of a component of what was drawn last at ``path`` with it."""
        found = next(one for one in reversed(self.logged[path]) if getattr(one, component, None) is not None)
        return getattr(found, component).as_arrow_array().to_pylist()

    def image(self, path: str) -> np.ndarray:
        return cv2.imdecode(np.frombuffer(bytes(self.last(path, "blob")[0]), np.uint8), cv2.IMREAD_UNCHANGED)


def made(**more: Any) -> tuple[ViewScene, Sink, ViewSetup]:
    setup, sink = ViewSetup("a test", 128, 96, 12, make_grid(), START, **more), Sink()
    return ViewScene([sink], setup), sink, setup  # type: ignore[list-item]


def field(**more: Any) -> StrainField:
    grid = make_grid()
    status = np.where(grid.active, 0, 1)
    status[2, 3], status[3, 4] = 7, 2  # a poor match, and no pattern
    return StrainField.from_values(grid, {"u": 2.0, "v": -1.0, "dv_dy": 1e-3} | more, 1e-5, status=status)


def test_maps_lie_on_their_zois_and_gauges_on_the_picture() -> None:
    """The picture of the viewer begins at 0 and ours at -0.5; a cell is a step wide."""
    scene, sink, _ = made(
        gauges=["axial"], outlines={"axial": (((10.0, 20.0), (30.0, 40.0)),)}, colours={"axial": 7}
    )
    scene.begin()
    for name in ("exx", "status"):
        assert sink.last(f"specimen/map/{name}", "translation") == [[15.5 + 0.5 - 8, 15.5 + 0.5 - 8, 0]]
        assert sink.last(f"specimen/map/{name}", "scale") == [[16, 16, 1]]
    assert sink.last("specimen/gauges", "strips") == [[[10.5, 20.5], [30.5, 40.5]]]
    assert sink.last("specimen/gauges/rim", "strips") == [[[10.5, 20.5], [30.5, 40.5]]]
    # The colours of the light page over the picture, those of the dark one in plots: the second of six.
    assert sink.last("specimen/gauges", "colors") == [0xBD4A00FF] and sink.last("gauges/axial", "colors") == [
        0xF59453FF
    ]
    assert sink.last("specimen/gauges/rim", "colors") == [0xFFFFFFFF]
    assert sink.last("specimen/gauges/names", "positions") == [[10.5, 20.5]]
    assert sink.last("specimen/gauges/names", "labels") == ["axial"]
    assert sink.last("gauges/axial", "names") == ["axial"]
    assert sink.last("specimen/zoi/boxes", "half_sizes")[0] == [16, 16]
    assert sink.times == [0.0]


def test_a_bar_has_the_colours_of_its_map_and_a_line_at_zero() -> None:
    scene, sink, _ = made(strain_range=2e-3)
    scene.field(START, field())
    for name, table in (("eyy", diverging_table()), ("sigma", sequential_table())):
        bar = sink.image(f"bar/{name}/ramp")[..., ::-1]
        assert (bar[0, 0] == table[-1]).all() and (bar[-1, 0] == table[0]).all()
        assert (bar[127:129] == 0).all() == (name == "eyy")
    drawn = len(sink.logged["bar/eyy/ramp"])
    scene.field(START + 3, field())
    assert len(sink.logged["bar/eyy/ramp"]) == drawn, "drawn only where it changes"


def test_rows_count_from_the_start_each_strain_with_its_sigma() -> None:
    scene, sink, _ = made(gauges=["axial"])
    scene.means([(START + 0.5, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0)])
    nothing = (START + 0.6, *(math.nan, 1.0) * 3)
    scene.means([nothing, (START - 1.0, math.nan, 1.0, 7.0, 8.0, math.nan, 1.0)])
    scene.loads([(START + 0.25, -30.0)])
    scene.gauge("axial", [(START + 2.0, 1e-3, 1e-5)])
    assert sink.rows["strain/exx"][0] == (0.5, 1.0, 2.0)
    assert sink.rows["strain/eyy"] == [(0.5, 3.0, 4.0), (0.0, 7.0, 8.0)]
    assert sink.rows["strain/exy"][0] == (0.5, 5.0, 6.0)
    assert sink.rows["load/force"] == [(0.25, -30.0)]
    assert sink.rows["gauges/axial"] == [(2.0, 1e-3, 1e-5)]


def test_strains_are_drawn_in_um_m_and_forces_in_newtons() -> None:
    values, variances = _columns("strain/eyy", [np.array([1e-3]), np.array([2e-6])])
    assert values.as_arrow_array().to_pylist() == [[pytest.approx(1000.0)]]
    assert variances.as_arrow_array().to_pylist() == [[pytest.approx(4.0)]]
    (forces,) = _columns("load/force", [np.array([12.5])])
    assert forces.as_arrow_array().to_pylist() == [[12.5]]


def test_a_field_by_value() -> None:
    scene, sink, setup = made(strain_range=2e-3)
    scene.field(START + 3.0, field())
    assert sink.times == [3.0]
    matrix, (shift,) = sink.last("specimen", "mat3x3"), sink.last("specimen", "translation")
    # Columns first; the middle of the ZOIs goes by (2, -1).
    assert pytest.approx(np.diag([1, 1 + 1e-3, 1])) == np.reshape(matrix[0], (3, 3)).T
    valid = field().ok
    middle = float(np.mean(np.broadcast_to(setup.grid.y[:, None], valid.shape)[valid])) + 0.5
    assert shift == pytest.approx([2.0, -1.0 - 1e-3 * middle, 0.0], abs=1e-5)
    assert sink.last("zoi/words", "labels") == ["displacement ×10 · 5 of 34 ZOIs outlined"]
    x, y = setup.grid.x + 0.5, setup.grid.y + 0.5
    assert sink.last("specimen/zoi/plain", "positions") == [[x[4], y[3]]]
    assert sink.last("specimen/zoi/rejected", "positions") == [[x[3], y[2]]]
    cells = sink.image("specimen/map/eyy")
    assert cells.shape == (*setup.grid.shape, 4)
    # A half of the range above zero: red, and what has no value is transparent.
    assert cells[1, 1].tolist() == [*diverging_table()[191][::-1], 225]
    assert cells[2, 3, 3] == cells[0, 0, 3] == 0
    assert sink.bytes == sum(len(sink.last(f"specimen/map/{name}", "blob")[0]) for name in
                             ("exx", "eyy", "exy", "e1", "e2", "sigma", "residual", "status"))  # fmt: skip


def test_the_ticks_of_a_bar_stand_at_their_values() -> None:
    scene, sink, _ = made(strain_range=2e-3)
    scene.field(START, field())
    assert sink.last("bar/eyy/ticks", "labels") == [
        "+2\u202f000", "+1\u202f000", "0", "−1\u202f000", "−2\u202f000", "µm/m",
    ]  # fmt: skip
    places, unit = np.array(sink.last("bar/eyy/ticks", "positions")), math.sqrt(128 * 96)
    assert places[:5, 0] == pytest.approx(128 + BAR_LABEL * unit, rel=1e-5)
    # From the top of the bar down; the label is drawn below its place.
    wanted = 96 * (BAR_TOP + BAR_HEIGHT * np.array([0, 0.25, 0.5, 0.75, 1])) - 0.028 * unit
    assert places[:5, 1] == pytest.approx(wanted, rel=1e-5)
    words = sink.last("bar/status/ticks", "labels")
    assert set(words) == {"OK 32", "POOR_MATCH 1", "NO_PATTERN 1"}


def test_each_zoi_of_a_finished_test_tells_its_values() -> None:
    scene, sink, setup = made(finished=True)
    shear = {"du_dx": -3e-4, "du_dy": 4e-4}
    scene.field(START, field(**shear))
    (dots, numbers) = sink.logged["/specimen/values"]
    labels = dots.labels.as_arrow_array().to_pylist()
    found = dict(zip(map(tuple, np.argwhere(setup.grid.active).tolist()), labels, strict=True))
    assert found[2, 3] == "ZOI 2, 3: POOR_MATCH"
    head, moved, exx, eyy, exy = found[1, 2].splitlines()
    assert (head, moved) == ("ZOI 1, 2", "u +2.0000  v -1.0000 px")
    assert exx.startswith("exx −300 ± 10 µm/m") and eyy.startswith("eyy 1\u202f000 ± 10 µm/m")
    assert exy.startswith("exy 200 ± 7 µm/m")
    assert dots.positions.as_arrow_array().to_pylist()[0] == [setup.grid.x[1] + 0.5, setup.grid.y[0] + 0.5]
    kept = {
        str(one.component_descriptor()): one.as_arrow_array().to_pylist()
        for one in numbers.as_component_batches()
    }
    k = list(found).index((1, 2))
    names = ("row", "column", "status", "u_px", "v_px", "exx_um_m", "eyy_um_m", "exy_um_m", "sigma_eyy_um_m")
    assert [kept[name][k] for name in names] == pytest.approx([1, 2, 0, 2, -1, -300, 1000, 200, 10])


def test_a_running_test_has_no_values_at_its_zois() -> None:
    scene, sink, _ = made()
    scene.field(START, field())
    assert "/specimen/values" not in sink.logged


@pytest.mark.parametrize("bits", [8, 12, 16])
@pytest.mark.parametrize(("light", "side", "scale"), [(False, 1000, 2.0), (True, 500, 4.0)])
def test_a_picture_keeps_its_size_and_its_grey_levels(
    light: bool, side: int, scale: float, bits: int
) -> None:
    """Of 2000 px, every second sent; reduced to 1280 or 640 px at most."""
    scene, sink, _ = made(light=light)
    image = np.full((800, 1000), 2**bits - 1, np.uint8 if bits == 8 else np.uint16)
    image[:, :500] = 0
    scene.picture(PictureMessage(image, bits, START + 1.5, 2))
    drawn = sink.image("camera/picture")
    assert drawn.shape == (side * 8 // 10, side) and sink.times == [1.5]
    assert drawn[5, 5] < 3 and drawn[5, -5] > 252
    assert sink.last("camera/picture", "scale") == [[scale] * 3]
    assert sink.bytes == len(sink.last("camera/picture", "blob")[0])


@pytest.mark.parametrize(("level", "shown"), [("info", "INFO"), ("warning", "WARN"), ("error", "ERROR")])
def test_an_event_is_a_line_with_its_time_and_its_level(level: Any, shown: str) -> None:
    scene, sink, _ = made()
    scene.events([Event(START + 12.34, EventKind.MEASURED, "measurement", "a burst")])
    assert "events" not in sink.logged
    scene.events([Event(START + 12.34, EventKind.DEVICE, "v4l2:/dev/video0?fps=5", "a fault", level)])
    assert sink.last("events", "text") == ["12.3 s  v4l2:/dev/video0: a fault"]
    assert sink.last("events", "level") == [shown]
    assert sink.times == [pytest.approx(12.34)]


def test_the_figures_and_the_card() -> None:
    scene, sink, _ = made()
    scene.figures(LargeFigures.of(Snapshot(START + 2.0, "REC", valid=1, zois=1, alarms=("limit",))))
    assert sink.times == [2.0] and sink.image("figures")[0, -1, 2] > 150
    scene.status("**well**")
    assert sink.last("status", "text") == ["**well**"] and sink.last("status", "media_type") == [
        "text/markdown"
    ]


def test_the_curve_is_stress_over_strain_with_its_last_value() -> None:
    scene, sink, _ = made(area_m2=20e-6)
    points = [(0.0, 0.0), (1e-3, 1000.0), (2e-3, 2000.0)]
    scene.points([*points, (math.nan, 5.0), (5.0, math.nan)])
    scene.field(START, field())
    line = np.array(sink.last("curve/line", "strips")[0])
    # 2000 um/m and 100 MPa of axes to 2500 and 120.
    assert line == pytest.approx(
        np.array([[0, 1], [0.4 * 1.6, 1 - 50 / 120], [0.8 * 1.6, 1 - 100 / 120]]), abs=1e-6
    )
    assert sink.last("curve/tip", "positions") == [pytest.approx(line[-1])]
    assert sink.last("curve/value", "labels") == ["2\u202f000 µm/m, 100 MPa"]
    assert sink.last("curve/value", "positions") == [pytest.approx(line[-1] + [-0.3, 0.17])]
    labels, places = sink.last("curve/ticks", "labels"), np.array(sink.last("curve/ticks", "positions"))
    assert labels[-2:] == ["axial strain (µm/m)", "stress (MPa)"]
    below = [k for k, (_, down) in enumerate(places[:-2]) if down == pytest.approx(1.03)]
    assert [labels[k] for k in below] == [f"{v:,}".replace(",", "\u202f") for v in range(0, 2501, 500)]
    assert places[below, 0] == pytest.approx(1.6 * np.arange(6) / 5, abs=1e-6)
    beside = [k for k in range(len(labels) - 2) if k not in below]
    for k in beside:
        assert places[k] == pytest.approx([-0.13, 0.95 - float(labels[k]) / 120], abs=1e-6)
    cross = np.array(sink.last("curve/axes", "strips"))
    assert cross == pytest.approx(np.array([[[0, 1], [1.6, 1]], [[0, 0], [0, 1]]]), abs=1e-6)


def test_the_value_of_the_curve_stands_where_there_is_room() -> None:
    drawn: dict[str, Any] = {}
    curve = CurveDrawing(made()[2])
    for x, y, beside in ((0.2, 9.0, (0.3, 0.17)), (0.2, -0.5, (0.3, -0.25)), (1.0, 9.0, (-0.3, 0.17))):
        for part in curve.draw(np.array([[1e-3, 10.0], [1e-3 * x, y]])):
            drawn |= part
        tip = np.array(drawn["curve/tip"].positions.as_arrow_array().to_pylist()[0])
        at = np.array(drawn["curve/value"].positions.as_arrow_array().to_pylist()[0])
        assert at - tip == pytest.approx(beside, abs=1e-6)
    assert drawn["curve/ticks"].labels.as_arrow_array().to_pylist()[-1] == "load (N)"


def test_the_axes_of_a_curve_by_value() -> None:
    axis = strain_axis(np.array([-1e-5, 1e-3]))
    assert (axis.low, axis.high) == (0.0, pytest.approx(1.2e-3)), "a side of noise takes no space"
    axis = strain_axis(np.array([-1e-4, 1e-3]))
    assert axis.low == pytest.approx(-1.2e-4)
    assert strain_axis(np.array([3.9e-6])).high == pytest.approx(2e-4)
    axis = stress_axis(np.array([0.0, 99e6]))
    assert (axis.high, axis.factor) == (pytest.approx(120e6), 1e-6)
    assert [mark * axis.factor for mark in axis.ticks] == pytest.approx([0, 25, 50, 75, 100])
    assert rounded(98.7654e6, axis) == "99 MPa"
    assert rounded(1.23456e-3, strain_axis(np.array([0.9e-3]))) == "1\u202f235 µm/m"
    assert [force_axis(np.array([f])).unit for f in (9999.0, -9999.0, 1e4, -1e4)] == ["N", "N", "kN", "kN"]
    assert force_axis(np.array([1e4])).factor == 1e-3
    axis = stress_axis(np.array([0.0, -120e6]))
    assert axis.low <= -120e6 and axis.high == 0, "compression"
    assert strain_axis(np.array([0.05])).unit == "%"
    for axis in (strain_axis(np.zeros(1)), stress_axis(np.zeros(1)), force_axis(np.zeros(1))):
        assert axis.high > axis.low and len(axis.ticks) >= 2


def parts_of(layout: Any) -> list[Any]:
    inside = getattr(layout, "contents", None)
    deeper = inside if isinstance(inside, list | tuple) and not isinstance(inside, str) else ()
    return [
        layout,
        *itertools.chain.from_iterable(parts_of(one) for one in deeper if not isinstance(one, str)),
    ]


@pytest.mark.parametrize(("axis", "front"), [("x", "exx"), ("y", "eyy")])
def test_the_strain_along_the_load_is_in_front(axis: Any, front: str) -> None:
    setup = replace(made()[2], axis=axis)
    tabs = next(one for one in parts_of(blueprint(setup).root_container) if type(one).__name__ == "Tabs")
    assert tabs.contents[tabs.active_tab].name == front
    shown = tabs.contents[tabs.active_tab].contents
    assert f"/specimen/map/{front}" in shown and f"/bar/{front}/**" in shown


def test_gauges_have_a_plot_in_front_of_the_mean() -> None:
    setup = replace(made()[2], gauges=["axial"])
    below = parts_of(blueprint(setup).root_container)
    tabs = [one for one in below if type(one).__name__ == "Tabs"][-1]
    assert [one.name for one in tabs.contents] == ["Gauges ± sigma, µm/m", "Mean strain ± sigma, µm/m"]
    assert tabs.active_tab == 0 and tabs.contents[0].origin == "/gauges"


def test_wide_pictures_are_one_above_the_other() -> None:
    kinds = {}
    for width in (210, 212):
        setup = replace(made()[2], width=width)
        middle = blueprint(setup).root_container.contents[1]
        kinds[width] = [type(one).__name__ for one in middle.contents]
    assert kinds == {210: ["Spatial2DView", "Tabs", "Spatial2DView"], 212: ["Vertical", "Spatial2DView"]}


def test_maps_of_the_whole_test_are_drawn_once() -> None:
    scene, sink, setup = made(finished=True, whole=("leaves_at_stress", "sigma_compliance"))
    scene.begin()
    at = np.full(make_grid().shape, 120e6, np.float32)
    at[2:], at[0, 0] = 160e6, np.nan
    scene.whole({"leaves_at_stress": at, "sigma_compliance": at * np.float32(1e-21), "fate": at})
    image = sink.image("specimen/map/leaves_at_stress")
    assert image.shape[:2] == at.shape and image[0, 0, 3] == 0 and image[0, 1, 3] > 0
    assert image[1, 3, 0] > image[1, 3, 2] and image[3, 3, 2] > image[3, 3, 0]  # blue is low, red is high
    assert sink.last("bar/leaves_at_stress/ticks", "labels")[-1] == "MPa"
    assert sink.last("bar/sigma_compliance/ticks", "labels")[-1] == "µm/m/MPa"
    assert sink.logged["bar/sigma_compliance/ramp"] and not sink.logged["specimen/map/fate"]
    assert blueprint(setup) is not None
