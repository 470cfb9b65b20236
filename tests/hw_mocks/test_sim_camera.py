"""The simulated camera: its clock, its ring, its losses, lock step, and the contract."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from acquire.addresses import parse_address
from acquire.errors import ConfigError, DeviceError
from acquire.events import Event, ignore_event
from acquire.frame import Frame
from hw_mocks.scene import Scene, Sensor
from hw_mocks.sim_camera import Ring, SimCamera, SimCameraSettings, open_sim_camera
from hw_mocks.specimen import specimen_from

SMALL = "width=64&height=48&seconds=1&fps=50"


def opened(
    settings: str, on_event: Callable[[Event], None] = ignore_event, kind: str = "uniform"
) -> SimCamera:
    address = parse_address(f"sim:{kind}?{SMALL}&{settings}")
    return open_sim_camera(address, on_event, specimen_from(address))


def lock_step(settings: str = "", on_event: Callable[[Event], None] = ignore_event) -> SimCamera:
    return opened("lockstep=yes" + ("&" + settings if settings else ""), on_event)


class FakeTime:
    """A clock that only sleeping moves, and a hook at each sleep."""

    def __init__(self, hook: Callable[[], None] = lambda: None) -> None:
        self.now, self._hook = 100.0, hook

    def clock(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        self.now += seconds
        self._hook()


def timed(time: FakeTime, buffers: int = 4, begun: float | None = None) -> SimCamera:
    """A camera on this clock; the test has ``begun`` with another one."""
    specimen = specimen_from(parse_address(f"sim:?{SMALL.rpartition('&')[0]}"))
    if begun is not None:
        specimen.clock.begin(begun)
    settings = SimCameraSettings(Sensor(), fps=50, buffers=buffers)
    return SimCamera(specimen, settings, "sim:", ignore_event, clock=time.clock, sleep=time.sleep)


def test_a_camera_that_joins_later_has_lost_nothing_before() -> None:
    time = FakeTime()
    with timed(time, 60, begun=time.now - 0.5) as camera:
        frames = list(camera)
    assert [frame.index for frame in frames] == list(range(25, 51))
    assert not any(frame.lost_before for frame in frames)
    assert frames[0].t == pytest.approx(time.now - 0.5, abs=0.6)


def frame(index: int) -> Frame:
    return Frame(np.zeros((1, 1), np.uint8), index, 0.0, "device", 0, 8, 0.0)


def test_lock_step_gives_every_frame_on_nominal_time() -> None:
    with lock_step() as camera:
        frames = list(camera)
    assert [f.index for f in frames] == list(range(51))
    np.testing.assert_allclose([f.t for f in frames], np.arange(51) / 50)
    assert {f.clock for f in frames} == {"nominal"} and not any(f.lost_before for f in frames)
    assert not camera.info.live and camera.info.clock == "nominal"
    assert not frames[0].image.flags.writeable


def test_lock_step_repeats_itself_bit_by_bit() -> None:
    runs = []
    for _ in range(2):
        with lock_step("seed=7") as camera:
            runs.append([f.image for f in camera])
    assert all(np.array_equal(one, two) for one, two in zip(*runs, strict=True))
    assert not np.array_equal(runs[0][0], runs[0][1])  # fresh noise while it holds


def test_lock_step_starts_at_the_offset() -> None:
    with lock_step("offset=12.5") as camera:
        first = next(iter(camera))
    assert first.t == 12.5 and first.index == 0


def test_frames_show_the_specimen_at_their_time() -> None:
    with lock_step("noise=0&bits=16&max_strain=0.05") as camera:
        frames = list(camera)
    for f in (frames[10], frames[40]):
        light = camera.scene.exact(camera.specimen.elapsed(f.t))
        np.testing.assert_allclose(f.image / 65535, light, atol=2e-5)


def test_second_iteration_goes_on() -> None:
    with lock_step() as camera:
        first = next(iter(camera))
        second = next(iter(camera))
    assert (first.index, second.index) == (0, 1)


def test_undrained_ring_drops_and_counts() -> None:
    time = FakeTime()
    camera = timed(time)
    with camera:
        camera._thread.join()
        frames = list(camera)
    assert [f.index for f in frames] == [0, 1, 2, 3]
    assert camera.dropped == 47
    assert frames[2].t == pytest.approx(100 + 2 / 50)
    assert frames[2].raw_t == pytest.approx(frames[2].t + 0.001)


def test_late_reader_sees_the_gap_in_the_sequence() -> None:
    sleeps = iter(range(1000))
    taken: list[tuple[Frame | None, bool]] = []

    def drain() -> None:
        if next(sleeps) == 20:
            taken.extend(camera._ring.get(0) for _ in range(4))

    camera = timed(FakeTime(drain))
    with camera:
        camera._thread.join()
        frames = list(camera)
    assert [f.index for f, _ in taken] == [0, 1, 2, 3]
    assert [f.index for f in frames] == [20, 21, 22, 23]
    assert frames[0].lost_before == 20  # the four taken by the back door count as lost too
    assert camera.dropped == 51 - 8


def test_live_runs_on_the_real_clock_and_ends() -> None:
    with opened("buffers=100") as camera:
        frames = list(camera)
    assert len(frames) + camera.dropped == 51
    assert camera.info.live and {f.clock for f in frames} == {"device"}
    assert camera.specimen.elapsed(frames[-1].t) == pytest.approx(frames[-1].index / 50)


@pytest.mark.parametrize("settings", ["seed=1", "lockstep=yes"])
def test_close_may_come_first_and_twice(settings: str) -> None:
    camera = opened(settings)
    camera.close()
    camera.close()
    with camera:
        assert list(camera) == []


def test_ring_is_finite_and_ends() -> None:
    ring = Ring(2)
    assert [ring.put(frame(i)) for i in range(3)] == [True, True, False]
    ring.close()
    got = [ring.get(0) for _ in range(3)]
    assert [f.index if f else None for f, _ in got] == [0, 1, None]
    assert [more for _, more in got] == [True, True, False]


def test_dropped_frames_are_a_gap() -> None:
    with lock_step("faults=drop@0.2*3") as camera:
        frames = list(camera)
    assert [f.index for f in frames][9:12] == [9, 13, 14]
    assert [f.lost_before for f in frames][9:12] == [0, 3, 0]


def test_damaged_frames_say_so() -> None:
    with lock_step("faults=damage@0.2*2") as camera:
        frames = list(camera)
    assert [f.index for f in frames if f.damaged] == [10, 11]
    assert not frames[10].image[24:].any() and frames[10].image[:24].any()


@pytest.mark.parametrize(("name", "word"), [("stall", "stalled"), ("disconnect", "disconnected")])
def test_stall_and_disconnection_are_events_and_a_gap(name: str, word: str) -> None:
    events: list[Event] = []
    with lock_step(f"faults={name}@0.2*0.3", events.append) as camera:
        frames = list(camera)
    assert [f.lost_before for f in frames if f.lost_before] == [15]
    assert [event.level for event in events] == ["error", "info"]
    assert all(word in event.text for event in events)


def test_camera_gone_for_good_is_an_error_after_its_last_frame() -> None:
    indices: list[int] = []
    with lock_step("faults=gone@0.5") as camera, pytest.raises(DeviceError, match="plug it in"):
        indices.extend(frame.index for frame in camera)
    assert indices == list(range(25))


@pytest.mark.parametrize(
    ("settings", "word"),
    [
        ("nose=1", "known: .*noise"),
        ("bits=9", "8, 10, 12, 16"),
        ("faults=explode@3", "unknown fault 'explode'; known: drop"),
        ("faults=drop", "name@seconds"),
        ("faults=drop@-1", "name@seconds"),
        ("exposure_us=1e6", "exposure_us"),
    ],
)
def test_bad_settings_are_refused(settings: str, word: str) -> None:
    with pytest.raises(ConfigError, match=word):
        opened(settings)


@pytest.mark.parametrize(
    ("renders_s", "fps"),
    [
        ([0.002], 30.0),
        ([0.019], 20.0),
        ([0.1], 5.0),
        pytest.param([9.0, 0.002, 0.002, 5.0, 0.002], 30.0, id="a single slow picture does not lower it"),
    ],
)
def test_automatic_rate_is_what_this_machine_renders(
    renders_s: list[float], fps: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    now, left = 0.0, list(renders_s)

    def rendered(self: Scene, t: float) -> np.ndarray:
        nonlocal now
        now += left.pop(0) if len(left) > 1 else left[0]
        return np.full((48, 64), 0.5, np.float32)

    monkeypatch.setattr("hw_mocks.sim_camera.time.perf_counter", lambda: now)
    monkeypatch.setattr(Scene, "render", rendered)
    address = parse_address("sim:uniform?width=64&height=48&fps=auto")
    with open_sim_camera(address, ignore_event, specimen_from(address)) as camera:
        assert camera.info.fps == fps


def test_a_frame_later_than_its_buffers_is_lost_and_no_other() -> None:
    """130 ms at one frame: the two after it are 90 and 70 ms late, three buffers at 50/s are 60 ms."""
    time = FakeTime()
    camera = timed(time, buffers=4)
    camera._ring = Ring(100)
    render = camera.scene.render

    def stalled(t: float) -> np.ndarray:
        time.now += 0.13 if t == 10 / 50 else 0.0
        return render(t)

    camera.scene.render = stalled
    with camera:
        camera._thread.join()
        indices = [frame.index for frame in camera]
    assert sorted({*range(51)} - {*indices}) == [11, 12] and camera.dropped == 2
