"""The drawing of the view: axes, what reaches each sink and how often, and positions on the picture."""

from __future__ import annotations

import contextlib
import math
import warnings
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from acquire.events import Event, EventKind
from analysis.field import StrainField
from analysis.field.grid import Roi, ZoiGrid
from live.pipeline.snapshot import Snapshot
from live.ui.rerun.drawing.layout import blueprint
from live.ui.rerun.drawing.scene import ViewScene
from live.ui.rerun.drawing.shapes import (
    ArrowScale,
    centres,
    mean_motion,
    region_edges,
    sample_boxes,
    thinned,
    with_heads,
)
from live.ui.rerun.drawing.sinks import ALL, Rates, RerunSink, write
from live.ui.rerun.messages import LargeFigures, PictureMessage, ViewSetup, ViewTarget, row_of
from tests.live.made_up import START, figures, make_field, make_frame, make_grid, make_measurement

chunk = pytest.importorskip("rerun.chunk")
check_for_rrd_footer = pytest.importorskip("rerun_bindings").check_for_rrd_footer


def make_setup(**more: Any) -> ViewSetup:
    return ViewSetup("a test", 128, 96, 12, make_grid(), START, **more)


def parts_of(path: Path) -> list[Any]:
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "RRD file has no footer")
        return list(chunk.RrdReader(path).stream())


def rows_in(path: Path) -> Counter[str]:
    rows: Counter[str] = Counter()
    for part in parts_of(path):
        rows[str(part.entity_path)] += part.num_rows
    return rows


@contextlib.contextmanager
def scene_into(
    sinks: dict[Path, Rates], setup: ViewSetup | None = None
) -> Iterator[tuple[ViewScene, RerunSink]]:
    import rerun as rr

    setup, made = setup or make_setup(), []
    for path, rates in sinks.items():
        stream = rr.RecordingStream("phasedic")
        stream.set_sinks(rr.FileSink(str(path)))
        stream.send_blueprint(blueprint(setup))
        made.append(RerunSink(stream, rates))
    scene = ViewScene(made, setup)
    scene.begin()
    yield scene, made[0]
    scene.end()


def draw_a_test(scene: ViewScene, seconds: float = 3.0) -> None:
    scene.events([Event(START, EventKind.START, "phasedic", "test started")])
    scene.status("**all is well**")
    for k in range(round(10 * seconds)):
        frame, measurement = make_frame(k, START + 0.1 * k), make_measurement(k, 1e-4 * k)
        scene.picture(PictureMessage(frame.image, 12, frame.t, 1))
        scene.loads([(START + 0.1 * k + 0.02 * j, 10.0 * k) for j in range(5)])
        scene.points([(1e-4 * k, 10.0 * k)])
        scene.means([row_of(measurement)])
        scene.field(measurement.t, measurement.field)
        now = figures(axial=1e-3, force=10.0 * k)
        scene.figures(LargeFigures.of(Snapshot(measurement.t, "REC", figures=now, valid=12, zois=12)))


STATIC = LAST = 1


def test_every_mean_is_drawn_and_pictures_and_maps_as_often_as_asked(tmp_path: Path) -> None:
    fast, slow = tmp_path / "fast.rrd", tmp_path / "slow.rrd"
    sinks = {fast: Rates(5.0, 10.0), slow: Rates(1.0, 2.0, 0.2)}
    with scene_into(sinks, make_setup(area_m2=4e-5)) as (scene, _):
        draw_a_test(scene)
    for path, pictures, maps in ((fast, 15, 30), (slow, 3, 6)):
        rows = rows_in(path)
        assert rows["/strain/eyy"] == rows["/strain/exy"] == 30 + STATIC
        assert rows["/load/force"] == 150 + STATIC
        assert rows["/camera/picture"] == pictures
        assert rows["/specimen/map/exx"] == maps + STATIC
        assert (
            rows["/specimen/map/status"]
            == rows["/specimen/map/e1"]
            == pytest.approx(maps / 4 + STATIC, abs=1)
        )
        assert rows["/figures"] == {10.0: 10, 2.0: 3}[maps / 3] + LAST
        assert rows["/curve/line"] == maps
        assert rows["/curve/axes"] >= 1  # drawn where it changes, in both
        assert rows["/specimen/zoi/boxes"] == STATIC
        assert rows["/events"] == rows["/status"] == 1


def test_what_a_server_forgets_is_sent_again(tmp_path: Path) -> None:
    path = tmp_path / "view.rrd"
    with scene_into({path: Rates(10.0, 10.0, repeat_bytes=20e3)}) as (scene, _):
        draw_a_test(scene)
    times: Counter[int] = Counter()
    for part in parts_of(path):
        if str(part.entity_path) == "/strain/eyy" and not part.is_static:
            times.update(part.to_record_batch().column("time").cast("int64").to_pylist())
    assert len(times) == 30
    assert max(times.values()) >= 2


def test_a_file_of_a_minute_has_few_parts_of_a_curve(tmp_path: Path) -> None:
    """Each part has a head of 1 kB."""
    path, setup = tmp_path / "view.rrd", make_setup()
    scene = ViewScene([write(setup, ViewTarget(None, str(path), "a-test"))], setup)
    scene.begin()
    for k in range(600):
        scene.means([(START + 0.1 * k, *(1e-6 * k, 1e-5) * 3)])
        scene.loads([(START + 0.1 * k, 1.0 * k)])
    scene.end()
    parts = Counter(str(part.entity_path) for part in parts_of(path) if not part.is_static)
    assert 1 <= parts["/strain/exx"] <= 7 and 1 <= parts["/load/force"] <= 7
    assert rows_in(path)["/strain/exx"] == 601, "with its style"


@pytest.mark.parametrize("finished", [False, True])
def test_the_file_of_a_running_test_has_no_footer(tmp_path: Path, finished: bool) -> None:
    """What it lists grows in memory with the file; the file of a finished test has one."""
    path, setup = tmp_path / "view.rrd", make_setup(finished=finished)
    scene = ViewScene([write(setup, ViewTarget(None, str(path), "a-test"))], setup)
    scene.begin()
    scene.field(START, make_measurement(1).field)
    scene.end()
    assert check_for_rrd_footer(str(path)) is finished
    assert rows_in(path)["/specimen/map/exx"] == 1 + STATIC


def test_what_does_not_change_is_not_drawn_again(tmp_path: Path) -> None:
    with scene_into({tmp_path / "a.rrd": Rates(math.inf, math.inf)}) as (scene, _):
        for number in range(10):
            scene.points([(1.9e-3 if number else 2e-3, 100.0)])
            scene.field(START + 0.1 * number, make_measurement(number // 5).field)
            scene.status("the same")
    rows = rows_in(tmp_path / "a.rrd")
    assert rows["/specimen/zoi/rejected"] == rows["/specimen/zoi/plain"] == rows["/zoi/words"] == 1
    assert rows["/zoi/displacement"] == rows["/status"] == 10
    assert rows["/curve/grid"] == rows["/bar/exx/ticks"] == rows["/bar/status/ticks"] == 1
    assert rows["/curve/line"] == 10


def test_a_field_without_one_valid_zoi_is_drawn(tmp_path: Path) -> None:
    grid, path = make_grid(), tmp_path / "view.rrd"
    field = StrainField.from_values(grid, {}, status=np.full(grid.shape, 5))
    with scene_into({path: Rates(5.0, 5.0)}, make_setup(axis="x")) as (scene, _):
        scene.field(START, field)
    assert rows_in(path)["/specimen/map/eyy"] == 1 + STATIC


def views_of(part: object) -> list[str]:
    """The names of all views of a layout."""
    inside = getattr(part, "contents", None)
    named = [str(part.name)] if type(part).__name__.endswith("View") else []  # type: ignore[attr-defined]
    return (
        named + [name for one in inside if not isinstance(one, str) for name in views_of(one)]
        if isinstance(inside, list | tuple)
        else named
    )


@pytest.mark.parametrize(
    ("more", "not_there"),
    [({}, set()), ({"with_load": False}, {"Load, N", "Load – strain"}), ({"finished": True}, {"Now"})],
)
def test_nothing_empty_takes_room(more: dict[str, Any], not_there: set[str]) -> None:
    shown = set(views_of(blueprint(make_setup(**more)).root_container))
    everything = {"Now", "Camera", "eyy", "status", "Load, N", "Load – strain", "Status", "Events"}
    assert everything - not_there <= shown and not not_there & shown


def test_centres_are_half_a_pixel_further_in_the_viewer() -> None:
    grid = ZoiGrid.cover(Roi(10, 20, 100, 80), size=33, step=16)
    np.testing.assert_array_equal(centres(grid)[0, 0], [10 + 16 + 0.5, 20 + 16 + 0.5])


def test_sample_boxes_are_active_and_do_not_overlap() -> None:
    grid = ZoiGrid.cover(Roi(0, 0, 1000, 700), size=64, step=8)
    boxes = sample_boxes(grid)
    assert 4 <= len(boxes) <= 30
    apart = np.abs(boxes[:, None] - boxes[None]).max(axis=-1) + 1e9 * np.eye(len(boxes))
    assert apart.min() >= 64
    few = ZoiGrid.cover(Roi(0, 0, 300, 300), size=40, step=100)
    assert len(sample_boxes(few)) == few.n_active, "all of them"


def test_very_many_points_are_thinned() -> None:
    grid = ZoiGrid.cover(Roi(0, 0, 1000, 1000), size=20, step=5)
    assert 1000 <= len(thinned(grid, np.ones(grid.shape, bool))) <= 2000
    assert len(thinned(grid, np.zeros(grid.shape, bool))) == 0
    assert len(ArrowScale().arrows(make_field(grid, 1e-3))[0]) <= 300


def test_the_maps_follow_the_specimen() -> None:
    grid = make_grid()
    x, y = np.meshgrid(grid.x, grid.y)
    values = {"u": 3.0 + 0.01 * x - 0.02 * y, "v": -1.0 + 0.03 * x + 0.05 * y}
    values |= {"du_dx": 0.01, "du_dy": -0.02, "dv_dx": 0.03, "dv_dy": 0.05}
    matrix, shift = mean_motion(StrainField.from_values(grid, values))
    point = np.array([40.0, 60.0, 0.0])
    half = np.array([0.5, 0.5, 0.0])
    moved = matrix @ (point + half) + shift - half
    expected = [40 + 3.0 + 0.4 - 1.2, 60 - 1.0 + 1.2 + 3.0, 0.0]
    np.testing.assert_allclose(moved, expected, atol=1e-9)


def test_nothing_measured_moves_nothing() -> None:
    grid = make_grid()
    field = StrainField.from_values(grid, {}, status=np.full(grid.shape, 5))
    matrix, shift = mean_motion(field)
    np.testing.assert_array_equal(matrix, np.eye(3))
    np.testing.assert_array_equal(shift, np.zeros(3))
    origins, vectors, factor = ArrowScale().arrows(field)
    assert (len(origins), len(vectors)) == (0, 0)
    assert factor > 0


def test_the_magnification_does_not_flicker() -> None:
    grid = make_grid()
    scale = ArrowScale()
    factors = {scale.arrows(make_field(grid, strain))[2] for strain in (1e-3, 1.01e-3, 0.98e-3, 0.7e-3)}
    assert len(factors) == 1


def test_the_edge_of_the_region() -> None:
    """Of a square ring of ZOIs: the outer square and the hole that no ZOI covers."""
    grid = ZoiGrid.cover(Roi(10, 20, 70, 70), size=20, step=10)
    active = np.ones(grid.shape, bool)
    active[1:-1, 1:-1] = False
    edges = region_edges(grid.subset(active=active))
    squares = {(10, 20, 80, 90): 4, (30, 40, 60, 70): 4}
    for (left, top, right, bottom), count in squares.items():
        corners = {(left, top), (right, top), (right, bottom), (left, bottom)}
        found = [e for e in edges.astype(int).tolist() if {tuple(e[0]), tuple(e[1])} <= corners]
        assert len(found) == count
    assert len(edges) == 8


def test_no_region_has_no_edge() -> None:
    grid = ZoiGrid.cover(Roi(10, 20, 70, 70), size=20, step=7)
    assert region_edges(grid.subset(active=np.zeros(grid.shape, bool))).shape == (0, 2, 2)


def test_an_arrow_has_its_head_at_its_tip() -> None:
    ((start, tip, left, again, right),) = with_heads(np.array([[10.0, 20.0]]), np.array([[0.0, 40.0]]))
    assert (*start, *tip, *again) == (10, 20, 10, 60, 10, 60)
    assert sorted([*left, *right]) == pytest.approx([4, 16, 48, 48])


@pytest.mark.parametrize(
    ("u", "factor"), [(1.0, 20.0), (0.02, 1000.0), (13.0, 1.0), (0.25, 100.0), (0.13, 100.0)]
)
def test_arrows_are_magnified_by_the_round_factor_below_what_fits(u: float, factor: float) -> None:
    """1.6 times the 16 px from one ZOI to the next fit, up to 1000 times."""
    field = StrainField.from_values(make_grid(), {"u": u})
    origins, vectors, magnified = ArrowScale().arrows(field)
    assert magnified == factor and len(origins) == field.n_valid
    np.testing.assert_allclose(vectors, np.tile([u * factor, 0.0], (len(vectors), 1)))


def test_a_row_of_means_has_each_strain_with_its_own_sigma() -> None:
    m = make_measurement(2)
    numbers = {"exx": 1.0, "sigma_exx": 2.0, "eyy": 3.0, "sigma_eyy": 4.0, "exy": 5.0, "sigma_exy": 6.0}
    step = replace(m.time_step, **numbers)
    assert row_of(replace(m, time_step=step)) == (m.time_step.t, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0)


def test_a_stream_that_cannot_be_ended_says_why() -> None:
    """As on a full disk: the thread of rerun that writes has ended."""

    class Full:
        ended = False

        def flush(self, timeout_sec: float) -> None:
            raise RuntimeError("File-writer thread shut down prematurely")

        def disconnect(self) -> None:
            self.ended = True

    stream = Full()
    assert RerunSink(stream, ALL).close() == "File-writer thread shut down prematurely" and stream.ended
