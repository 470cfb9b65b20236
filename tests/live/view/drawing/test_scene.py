"""What is drawn stands where it was drawn to, as often as it should."""

from __future__ import annotations

import contextlib
import math
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from acquire.events import Event, EventKind
from analysis.field import StrainField
from live.measure import Snapshot
from live.view import ViewSetup
from live.view.drawing.layout import blueprint
from live.view.drawing.marks import reduced
from live.view.drawing.places import Place, Rates
from live.view.drawing.scene import Scene
from live.view.exchange.messages import Picture, row_of
from tests.live.made_up import START, make_frame, make_grid, make_measurement

chunk = pytest.importorskip("rerun.chunk")


def make_setup(**more: Any) -> ViewSetup:
    return ViewSetup("a test", 128, 96, 12, make_grid(), START, **more)


def rows_in(path: Path) -> Counter[str]:
    rows: Counter[str] = Counter()
    for part in chunk.RrdReader(path).stream():
        rows[str(part.entity_path)] += part.num_rows
    return rows


@contextlib.contextmanager
def scene_into(places: dict[Path, Rates], setup: ViewSetup | None = None) -> Iterator[tuple[Scene, Place]]:
    import rerun as rr

    setup, made = setup or make_setup(), []
    for path, rates in places.items():
        stream = rr.RecordingStream("phasedic")
        stream.set_sinks(rr.FileSink(str(path)))
        stream.send_blueprint(blueprint(setup))
        made.append(Place(stream, rates))
    scene = Scene(made, setup)
    scene.begin()
    yield scene, made[0]
    scene.end()


def draw_a_test(scene: Scene, seconds: float = 3.0) -> None:
    scene.event(Event(START, EventKind.START, "phasedic", "test started"))
    scene.status("**all is well**")
    for k in range(round(10 * seconds)):
        frame, measurement = make_frame(k, START + 0.1 * k), make_measurement(k, 1e-4 * k)
        scene.picture(Picture(frame.image, 12, frame.t, 1))
        scene.loads([(START + 0.1 * k + 0.02 * j, 10.0 * k) for j in range(5)])
        scene.points([(1e-4 * k, 10.0 * k)])
        scene.means([row_of(measurement)])
        scene.field(measurement.t, measurement.field)
        scene.figures(Snapshot(measurement.t, "REC", axial=1e-3, force_N=10.0 * k, valid=12, zois=12))


STATIC = 1


def test_every_mean_is_drawn_and_pictures_and_maps_as_often_as_asked(tmp_path: Path) -> None:
    fast, slow = tmp_path / "fast.rrd", tmp_path / "slow.rrd"
    places = {fast: Rates(5.0, 10.0), slow: Rates(1.0, 2.0, 0.2)}
    with scene_into(places, make_setup(area_m2=4e-5)) as (scene, _):
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
        assert rows["/figures"] == {10.0: 10, 2.0: 3}[maps / 3]
        assert rows["/curve/line"] == maps
        assert rows["/curve/axes"] >= 1  # drawn where it changes, in both
        assert rows["/specimen/zoi/boxes"] == STATIC
        assert rows["/events"] == rows["/status"] == 1


def test_beyond_the_limit_pictures_and_maps_stop_and_curves_go_on(tmp_path: Path) -> None:
    path = tmp_path / "view.rrd"
    with scene_into({path: Rates(10.0, 10.0, limit_bytes=20e3)}) as (scene, place):
        draw_a_test(scene)
        assert 20e3 <= place.drawn_bytes < 40e3
    rows = rows_in(path)
    assert rows["/strain/eyy"] == 31
    assert 1 <= rows["/camera/picture"] < 30
    assert 1 <= rows["/specimen/map/exx"] < 30


def test_what_a_server_forgets_is_sent_again(tmp_path: Path) -> None:
    path = tmp_path / "view.rrd"
    with scene_into({path: Rates(10.0, 10.0, repeat_bytes=20e3)}) as (scene, _):
        draw_a_test(scene)
    times: Counter[int] = Counter()
    for part in chunk.RrdReader(path).stream():
        if str(part.entity_path) == "/strain/eyy" and not part.is_static:
            times.update(part.to_record_batch().column("time").cast("int64").to_pylist())
    assert len(times) == 30
    assert max(times.values()) >= 2


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


def test_a_thinned_picture_keeps_its_size_on_the_screen(tmp_path: Path) -> None:
    path = tmp_path / "view.rrd"
    with scene_into({path: Rates(5.0, 5.0)}) as (scene, _):
        scene.picture(Picture(np.zeros((48, 64), np.uint8), 8, START, 2))
    columns = {
        name
        for part in chunk.RrdReader(path).stream()
        if str(part.entity_path) == "/camera/picture"
        for name in part.to_record_batch().schema.names
    }
    assert "Transform3D:scale" in columns


def test_a_field_without_one_valid_zoi_is_drawn(tmp_path: Path) -> None:
    grid, path = make_grid(), tmp_path / "view.rrd"
    field = StrainField.from_values(grid, {}, status=np.full(grid.shape, 5))
    with scene_into({path: Rates(5.0, 5.0)}, make_setup(axis="x")) as (scene, _):
        scene.field(START, field)
    assert rows_in(path)["/specimen/map/eyy"] == 1 + STATIC


@pytest.mark.parametrize("bits", [8, 12, 16])
def test_large_pictures_are_reduced_to_eight_bits(bits: int) -> None:
    top = 2**bits - 1
    image = np.full((300, 500), top, np.uint8 if bits == 8 else np.uint16)
    image[:, :250] = 0
    small, factor = reduced(image, bits, 200)
    assert (factor, small.shape, small.dtype) == (3, (100, 166), np.uint8)
    assert (small[0, 0], small[0, -1]) == (0, 255)


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
