"""The view: nothing blocks or raises into the test, and what was shown stands in the file."""

from __future__ import annotations

import contextlib
import logging
import socket
import threading
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from acquire.events import Event, EventKind
from live.view.marks import reduced
from live.view.publisher import Publisher
from live.view.rerun_view import RerunView, ViewSetup
from live.view.scene import Scene
from live.view.setup import Rates
from live.view.viewer import free_port, has_display, spawn_viewer, url, viewer_binary
from tests.live.made_up import START, make_frame, make_grid, make_measurement

chunk = pytest.importorskip("rerun.chunk")


def make_setup(**more: Any) -> ViewSetup:
    return ViewSetup("a test", 128, 96, 12, make_grid(), START, **more)


def rows_in(path: Path) -> Counter[str]:
    rows: Counter[str] = Counter()
    for part in chunk.RrdReader(path).stream():
        rows[str(part.entity_path)] += part.num_rows
    return rows


def show_a_test(view: RerunView, seconds: float = 3.0) -> None:
    view.event(Event(START, EventKind.START, "phasedic", "test started"))
    view.status("**E** 70 GPa")
    for k in range(round(10 * seconds)):
        view.picture(make_frame(k, START + 0.1 * k))
        for j in range(10):
            view.load(START + 0.1 * k + 0.01 * j, 10.0 * k)
        view.show(make_measurement(k, 1e-4 * k))
        view.settled(make_measurement(k, 1e-4 * k, force=10.0 * k))


class Slow:
    """A drawing that waits to be let on, and notes what it was given."""

    def __init__(self) -> None:
        self.begun, self.go = threading.Event(), threading.Event()
        self.drawn: list[Any] = []

    def begin(self) -> None:
        self.begun.set()
        assert self.go.wait(30)

    def end(self) -> None:
        self.drawn.append("end")

    def __getattr__(self, name: str) -> Any:
        return lambda what: self.drawn.append((name, what))

    def all(self, name: str) -> list[Any]:
        return [item[1] for item in self.drawn if item[0] == name]


def test_the_newest_win_and_the_rest_is_counted() -> None:
    slow = Slow()
    publisher = Publisher("slow", slow)
    assert slow.begun.wait(30)
    measurements = [make_measurement(k) for k in range(10)]
    for measurement in measurements:
        publisher.measurement(measurement)
        publisher.picture(make_frame(measurement.number, 0.0))
        publisher.load(measurement.t, 1.0)
    publisher.event(Event(START, EventKind.NOTE, "operator", "hello"))
    publisher.status("old")
    publisher.status("new")
    slow.go.set()
    assert publisher.close(30)
    assert slow.all("measurement") == measurements[-2:]
    assert [frame.index for frame in slow.all("picture")] == [9]
    assert len(slow.all("loads")[0]) == 10
    assert len(slow.all("event")) == 1
    assert slow.all("status") == ["new"]
    assert publisher.skipped == 8
    assert publisher.dropped == 0
    assert slow.drawn[-1] == "end"


def test_loads_and_events_are_bounded_and_counted() -> None:
    slow = Slow()
    publisher = Publisher("slow", slow)
    assert slow.begun.wait(30)
    for k in range(20_100):
        publisher.load(float(k), 0.0)
    slow.go.set()
    assert publisher.close(30)
    assert publisher.dropped == 100
    assert len(slow.all("loads")[0]) == 20_000
    assert slow.all("loads")[0][-1][0] == 20_099


class Panic(BaseException):
    """As the Rust side raises."""


def test_a_trouble_in_rerun_ends_the_publisher_alone(caplog: pytest.LogCaptureFixture) -> None:
    class Broken(Slow):
        def begin(self) -> None:
            raise Panic("index out of bounds")

    publisher = Publisher("broken", Broken())
    assert publisher.close(30)
    assert publisher.failed is not None
    assert "index out of bounds" in publisher.failed
    assert len([record for record in caplog.records if record.levelno >= logging.ERROR]) == 1
    publisher.measurement(make_measurement(0))


def test_a_stuck_publisher_is_left_behind() -> None:
    slow = Slow()
    publisher = Publisher("stuck", slow)
    assert slow.begun.wait(30)
    assert not publisher.close(0.01)
    assert "left behind" in (publisher.failed or "")
    slow.go.set()
    assert publisher.close(30)


@contextlib.contextmanager
def scene_into(path: Path, rates: Rates, setup: ViewSetup | None = None) -> Iterator[Scene]:
    import rerun as rr

    stream = rr.RecordingStream("phasedic")
    stream.set_sinks(rr.FileSink(str(path)))
    scene = Scene(stream, setup or make_setup(), rates)
    scene.begin()
    yield scene
    scene.end()


def draw_a_test(scene: Scene, seconds: float = 3.0) -> None:
    for k in range(round(10 * seconds)):
        scene.picture(make_frame(k, START + 0.1 * k))
        scene.loads([(START + 0.1 * k + 0.01 * j, 10.0 * k) for j in range(10)])
        scene.points([(1e-4 * k, 10.0 * k)])
        scene.measurement(make_measurement(k, 1e-4 * k))


def test_every_mean_is_drawn_and_pictures_and_maps_as_often_as_asked(tmp_path: Path) -> None:
    with scene_into(tmp_path / "view.rrd", Rates(1.0, 2.0, 80, 1280), make_setup(area_m2=4e-5)) as scene:
        draw_a_test(scene)
    rows = rows_in(tmp_path / "view.rrd")
    static = 1
    assert rows["/strain/eyy"] == rows["/strain/exy"] == 30 + static
    assert 90 <= rows["/load/force"] <= 151  # 300 came
    assert rows["/camera/picture"] == 3
    assert rows["/specimen/map/exx"] == 6 + static
    assert rows["/curve/line"] == 6
    assert rows["/specimen/zoi/boxes"] == static


def test_beyond_the_limit_pictures_and_maps_stop_and_curves_go_on(tmp_path: Path) -> None:
    with scene_into(tmp_path / "view.rrd", Rates(10.0, 10.0, 80, 1280, limit_bytes=20e3)) as scene:
        draw_a_test(scene)
        assert 20e3 <= scene.drawn_bytes < 40e3
    rows = rows_in(tmp_path / "view.rrd")
    assert rows["/strain/eyy"] == 31
    assert 1 <= rows["/camera/picture"] < 30
    assert 1 <= rows["/specimen/map/exx"] < 30


def test_what_a_server_forgets_is_sent_again(tmp_path: Path) -> None:
    with scene_into(tmp_path / "view.rrd", Rates(10.0, 10.0, 80, 1280, repeat_bytes=20e3)) as scene:
        draw_a_test(scene)
    times: Counter[int] = Counter()
    for part in chunk.RrdReader(tmp_path / "view.rrd").stream():
        if str(part.entity_path) == "/strain/eyy" and not part.is_static:
            times.update(part.to_record_batch().column("time").cast("int64").to_pylist())
    assert len(times) == 30
    assert max(times.values()) >= 2


def test_what_was_shown_stands_in_the_file(tmp_path: Path) -> None:
    view = RerunView(make_setup(), port=None, rrd=tmp_path / "view.rrd")
    show_a_test(view)
    view.close(30)
    assert view.failed is None
    assert "view.rrd" in view.address
    rows = rows_in(tmp_path / "view.rrd")
    assert rows["/strain/eyy"] == 30 - view.skipped + 1
    assert rows["/events"] == 1
    assert rows["/status"] == 1


def test_it_serves_on_the_next_port_when_the_wanted_one_is_taken(tmp_path: Path) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        wanted = taken.getsockname()[1]
        view = RerunView(make_setup(), port=wanted, rrd=None)
        show_a_test(view, 0.5)
        assert view.port is not None
        assert view.port > wanted
        assert str(view.port) in view.address
        view.close(30)
    assert view.failed is None


def test_a_file_that_exists_is_left_alone_and_told(tmp_path: Path) -> None:
    path = tmp_path / "view.rrd"
    path.write_text("precious")
    view = RerunView(make_setup(), port=None, rrd=path)
    show_a_test(view, 0.2)
    view.close(5)
    assert "exists already" in (view.failed or "")
    assert view.rrd is None
    assert path.read_text() == "precious"


def test_a_folder_that_is_not_there_is_told(tmp_path: Path) -> None:
    view = RerunView(make_setup(), port=None, rrd=tmp_path / "no" / "view.rrd")
    show_a_test(view, 0.2)
    view.close(5)
    assert "all else goes on" in (view.failed or "")


def test_without_any_place_it_does_nothing() -> None:
    view = RerunView(make_setup(), port=None, rrd=None)
    show_a_test(view, 0.2)
    view.close()
    assert (view.failed, view.skipped, view.address) == (None, 0, "")


def test_a_field_without_one_valid_zoi_is_drawn(tmp_path: Path) -> None:
    from analysis.field.strain_field import StrainField

    grid = make_grid()
    lost = make_measurement(0)
    field = StrainField.from_values(grid, {}, status=np.full(grid.shape, 5))
    view = RerunView(make_setup(axis="x"), port=None, rrd=tmp_path / "view.rrd")
    view.show(type(lost).of(0, lost.burst, field, 1.0))
    view.close(30)
    assert view.failed is None


@pytest.mark.parametrize("bits", [8, 12, 16])
def test_large_pictures_are_reduced_to_eight_bits(bits: int) -> None:
    top = 2**bits - 1
    image = np.full((300, 500), top, np.uint8 if bits == 8 else np.uint16)
    image[:, :250] = 0
    small, factor = reduced(image, bits, 200)
    assert (factor, small.shape, small.dtype) == (3, (100, 166), np.uint8)
    assert (small[0, 0], small[0, -1]) == (0, 255)


def test_the_viewer_is_found_but_not_opened_without_a_display(monkeypatch: pytest.MonkeyPatch) -> None:
    assert viewer_binary() is not None
    monkeypatch.setattr("sys.platform", "linux")
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    assert not has_display()
    assert spawn_viewer(9876) is None


def test_a_free_port_is_taken_as_it_is() -> None:
    port = free_port(42_000)
    assert port is not None
    assert url(port) == f"rerun+http://127.0.0.1:{port}/proxy"
    assert free_port(65_536) is None
