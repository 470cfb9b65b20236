"""The part of a source that is replayed, its first burst, its windows, and what the summary says of it."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from acquire.errors import ConfigError, DataError
from acquire.events import Event, EventKind
from acquire.frame import Burst, CameraInfo, Frame, frozen
from acquire.load_cell.load_log import LoadLog
from acquire.load_sample import LoadSample
from acquire.record_mode import RecordMode
from live.config.loading import load_config
from live.pipeline.measure import NewReference
from live.pipeline.run_state import RunState
from live.replay.burst_index import open_store
from live.replay.forces import read_forces
from live.replay.opening import _measured_within, session_config
from live.replay.pictures import _expected, picture_of
from live.replay.replay import _account, _with_final_folder, speed_line
from live.replay.source import PictureCount, ReplayRequest, Window, check_window
from live.replay.study import NO_WINDOW, StudySetting, _found, _largest, _loaded, still_window, take_windows
from tests.live.fakes import frame
from tests.live.made_up import START, make_measurement

REQUEST = ReplayRequest("session.h5", None, {})


def part(low: float | None, high: float | None) -> Window:
    return Window.of(replace(REQUEST, start_s=low, end_s=high), START)


def test_the_ends_of_a_part_belong_to_it() -> None:
    bursts = [make_measurement(k).burst for k in range(8)]
    times = np.array([burst.t for burst in bursts])
    window = part(times[2] - START, times[4] - START)
    assert [burst.first_index for burst in window.part(bursts) if isinstance(burst, Burst)] == [16, 24, 32]
    assert window.numbers(times) == range(2, 5)
    assert part(None, None).numbers(times) == range(8)
    assert part(5.0, None).numbers(times) == range(7, 8) and part(5.0, None).numbers(times[:0]) == range(0)


def test_new_references_pass_whatever_the_part_is() -> None:
    items = [NewReference(make_measurement(0).burst), make_measurement(3).burst]
    assert list(part(0.2, 0.4).part(items)) == items
    with pytest.raises(
        DataError, match=r"no burst lies between --from and --to; the last one is at 0\.300 s"
    ):
        list(part(1.0, 2.0).part(items))
    assert list(part(1.0, 2.0).part(items[:1])) == items[:1]


@pytest.mark.parametrize(("start", "end", "good"), [(0.0, 1.0, True), (1.0, 1.0, False), (2.0, 1.0, False)])
def test_a_part_begins_before_it_ends(start: float | None, end: float | None, good: bool) -> None:
    request = replace(REQUEST, start_s=start, end_s=end)
    if good:
        check_window(request)
    else:
        with pytest.raises(ConfigError, match=r"--from .* must be before --to "):
            check_window(request)


def test_of_a_part_that_holds_no_measured_burst_the_last_is_read_for_the_message() -> None:
    events = [
        Event(START + k, kind, "m", "", "info", {"first": 10 * k})
        for k, kind in enumerate((EventKind.MEASURED, EventKind.REFERENCE, EventKind.MEASURED))
    ]
    assert _measured_within(events, part(0.0, 1.0)) == {0}
    assert _measured_within(events, part(5.0, 6.0)) == {20}
    assert _measured_within(events[:0], part(5.0, 6.0)) == set()


class EverySecond:
    """A session of each second frame, the third of them damaged."""

    mode = RecordMode.parse("every=2")
    indices = np.arange(0, 12, 2)

    def __len__(self) -> int:
        return 6

    def frames(self, start: int = 0, stop: int | None = None) -> Any:
        made = [frame(2 * k, value=10 * k, damaged=k == 2) for k in range(6)]
        return iter(made[start:stop])


def test_of_a_session_with_gaps_the_first_whole_frames_are_the_reference() -> None:
    store = open_store(EverySecond(), Path("session.h5"))  # type: ignore[arg-type]
    burst, last = store.first_burst(2)
    assert (burst.n, burst.first_index, burst.last_index, last) == (2, 0, 2, 2)
    assert float(burst.mean[0, 0]) == 5.0 and burst.lost == 0
    with pytest.raises(DataError, match="fewer than 3 whole frames; give a smaller --reference-burst"):
        store.first_burst(3)
    with pytest.raises(ConfigError, match="holds only one frame in 2, 2 of them are no burst"):
        store.index_after(-1, 2)


def test_a_burst_between_recorded_frames_is_the_next_one() -> None:
    store = open_store(EverySecond(), Path("session.h5"))  # type: ignore[arg-type]
    assert store.burst({"first": 1, "last": 1, "n": 1}).first_index == 2
    assert store.burst({"first": 3, "last": 4, "n": 2}).first_index == 6, "the fifth frame is damaged"
    both = store.burst({"first": 5, "last": 9, "n": 5})
    assert (both.first_index, both.last_index, both.n) == (6, 8, 2)
    with pytest.raises(DataError, match="of the frames 11 to 12, and after them, none is recorded"):
        store.burst({"first": 11, "last": 12, "n": 2})


def test_the_picture_of_a_burst_is_its_mean_rounded() -> None:
    burst = replace(make_measurement(1).burst, mean=np.array([[0.4, 0.6], [1.5, 254.7]], np.float32))
    shown = picture_of(replace(burst, bits=8))
    assert shown.image.tolist() == [[0, 1], [2, 255]] and shown.image.dtype == np.uint8
    assert picture_of(burst).image.dtype == np.uint16
    assert (shown.index, shown.t, shown.bits, shown.clock) == (8, burst.t, 8, "device")
    one = replace(burst, bits=8, mean=np.zeros((2, 2), np.uint8))  # type: ignore[arg-type]
    assert picture_of(one).image is one.mean


@pytest.mark.parametrize(
    ("controls", "taken", "burst", "expected"),
    [
        ({"files": 11}, 1, 1, 10), ({"files": 11}, 1, 3, 3), ({"frames": 11}, 0, 2, 5), ({"files": 1}, 1, 1, None),
        ({}, 0, 1, None),
    ],
)  # fmt: skip
def test_so_many_bursts_are_expected(
    controls: dict[str, int], taken: int, burst: int, expected: int | None
) -> None:
    camera = CameraInfo("files:", "files", 4, 2, 8, live=False, clock="nominal", controls=controls)
    assert _expected(camera, taken, load_config(None, {"measure.burst": burst})) == expected


def stored_session(**sections: Any) -> Any:
    return SimpleNamespace(config=sections, metadata={"operator": "J"})


def test_settings_of_the_command_line_come_before_those_of_a_file_and_of_the_session(tmp_path: Path) -> None:
    rig = tmp_path / "rig.toml"
    rig.write_text("[measure]\nzoi = 32\nstep = 8\n")
    stored = stored_session(measure={"zoi": 64, "step": 16, "burst": 3}, output={"dir": "x"}, alarm={"1": {}})
    request = replace(REQUEST, config_file=rig, overrides={"measure.step": 4})
    found = session_config(stored, request, {"camera.address": "session:a"}, tmp_path / "session.h5")
    assert (found.measure.zoi, found.measure.step, found.measure.burst) == (32, 4, 3)
    assert (found.camera.address, found.output.dir, found.alarm) == ("session:a", None, ())
    assert (found.measure.strain, found.metadata) == ("small", {"operator": "J"})
    measured = session_config(
        stored_session(measure={"strain": "green"}), REQUEST, {}, tmp_path / "session.h5"
    )
    assert measured.measure.strain == "green"


def test_an_error_in_the_session_is_one_of_the_data_and_in_the_command_line_one_of_the_settings() -> None:
    path = Path("session.h5")
    with pytest.raises(DataError, match=r"measure\.zoi = 3 .*the command line can override it"):
        session_config(stored_session(measure={"zoi": 3}), REQUEST, {}, path)
    with pytest.raises(ConfigError, match=r"measure\.zoi = 4 is not possible"):
        session_config(stored_session(), replace(REQUEST, overrides={"measure.zoi": 4}), {}, path)


def test_a_mask_is_looked_for_beside_a_session_that_was_moved(tmp_path: Path) -> None:
    kept = tmp_path / "kept.png"
    kept.touch()
    stored = stored_session(
        measure={"mask": "/gone/run/mask.png"}, camera={"dark": str(kept), "flat": "/gone/flat.tif"}
    )
    found = session_config(stored, REQUEST, {}, tmp_path / "session.h5")
    assert found.measure.mask == str(tmp_path / "mask.png")
    assert (found.camera.dark, found.camera.flat) == (str(kept), str(tmp_path / "flat.tif"))


def test_the_summary_has_the_speed_and_the_share_of_the_kernel() -> None:
    state = RunState.new(0.5)
    for k in range(4):
        step = make_measurement(k).time_step
        state.history.add(replace(step, measure_s=0.125, n_zoi=1000))
    line = speed_line(state.history, 2.0)
    assert line == "4 bursts in 2 s: 2 bursts/s, 2 000 ZOI/s, of that time 25% in the kernel"


@pytest.mark.parametrize(
    ("measured", "rest", "why", "more"),
    [(6, 0, 2, ""), (4, 2, 5, ""), (4, 2, 7, "  ... and 2 more; the log (-v) has all")],
)
def test_pictures_that_were_left_out_are_counted_and_some_named(
    measured: int, rest: int, why: int, more: str
) -> None:
    state, count = RunState.new(0.5), PictureCount()
    list(count.passing(frame(k, damaged=k < 3) for k in range(10)))
    count.reference = 1
    state.frame_counts.add(measured=measured)
    for k in range(why):
        state.event_log.record(Event(0.0, EventKind.DEVICE, "files", f"a{k}.png is no picture", "warning"))
    source: Any = SimpleNamespace(count=count)
    lines = _account(source, state)
    words = f"10 pictures: reference 1, measured {measured}, left out 3"
    assert lines[0] == words + f", of no whole burst {rest}" * (rest > 0)
    assert lines[1:6] == [f"  a{k}.png is no picture" for k in range(min(why, 5))]
    assert lines[6:] == ([more] if more else [])
    count.left_out = 0
    assert _account(source, state) == [] and _account(SimpleNamespace(count=None), state) == []  # type: ignore[arg-type]


def test_pictures_that_are_the_one_before_in_every_bit_are_told() -> None:
    noise = np.random.default_rng(1)
    images = [frozen(noise.integers(1, 99, (8, 8)).astype(np.uint8)) for _ in range(4)]
    damaged, black = frozen(images[3] * 0), frozen(images[0] * 0)
    shown = [
        images[0],
        images[1],
        images[2],
        images[2].copy(),
        images[2],
        images[3],
        damaged,
        damaged,
        black,
        black,
    ]
    frames = [
        Frame(frozen(image), k, float(k), "nominal", 0, 8, float(k), damaged=image is damaged)
        for k, image in enumerate(shown)
    ]
    count = PictureCount()
    assert list(count.passing(frames)) == frames
    assert (
        len(count.repeats) == 1 and "2 of 10 pictures" in count.repeats[0] and "number 4:" in count.repeats[0]
    )
    few = PictureCount()
    assert list(few.passing(frames[:3])) and few.repeats == []


def test_results_name_the_folder_where_they_will_be() -> None:
    config = load_config(None, {"measure.mask": "/tmp/a/mask.png", "output.dir": "/tmp/a"})
    assert _with_final_folder(config, None) is config
    found = _with_final_folder(config, Path("/out/test"))
    assert (found.measure.mask, found.output.dir) == ("/out/test/mask.png", "/out/test")
    assert _with_final_folder(load_config(None, {}), Path("/out/test")).measure.mask is None


def source_of(forces: dict[float, float], count: int = 60) -> Any:
    """Ten bursts a second, and a load cell with these forces at these times."""
    loads = LoadLog(100.0)
    for t, force in forces.items():
        loads.append(LoadSample(START + t, force))
    loads.close()
    bursts = [make_measurement(k).burst for k in range(count)]
    times = np.array([burst.t for burst in bursts])
    return SimpleNamespace(loads=loads, bursts=bursts, times=times, start=SimpleNamespace(monotonic=START))


def test_the_loaded_window_is_where_the_force_is_near_its_largest_about_that() -> None:
    forces = {
        0.0: 99.0,
        1.0: 0.0,
        2.0: 97.9,
        2.5: 98.0,
        3.0: 100.0,
        3.5: 98.5,
        4.0: 90.0,
        5.0: 99.9,
        5.5: 0.0,
    }
    assert _loaded(source_of(forces)) == (2.5, 3.5)
    assert _loaded(source_of({t: -f for t, f in forces.items()})) == (2.5, 3.5)
    assert _loaded(source_of({0.0: 1.0, 1.0: math.nan})) == (0.0, 0.0)
    for nothing in ({}, {0.0: math.nan}):
        with pytest.raises(DataError, match="give --loaded A,B in seconds"):
            _loaded(source_of(nothing))


def firsts(bursts: Any) -> list[int]:
    return [burst.first_index // 8 for burst in bursts]


def test_the_windows_take_their_bursts_evenly_and_no_more_than_needed() -> None:
    found = take_windows(source_of({}), (0.0, 3.05), (4.0, 4.15))
    assert (firsts(found.still), firsts(found.loaded)) == ([0, 4, 9, 13, 17, 21, 26, 30], [40, 41])
    assert firsts(take_windows(source_of({}), (0.0, 0.95), (4.0, 4.95)).loaded) == [40, 42, 44, 45, 47, 49]
    assert firsts(take_windows(source_of({}), NO_WINDOW, (4.0, 4.15)).still) == []
    with pytest.raises(DataError, match=r"1 bursts from 4 to 4\.05 s, 2 are needed; give --loaded A,B"):
        take_windows(source_of({}), (0.0, 3.05), (4.0, 4.05))
    with pytest.raises(DataError, match="are needed; give --static A,B"):
        take_windows(source_of({}), (0.0, 0.05), (4.0, 4.15))
    renewed = source_of({})
    renewed.bursts.insert(5, NewReference(renewed.bursts[0]))
    with pytest.raises(DataError, match="the reference was renewed in this session"):
        take_windows(renewed, (0.0, 3.05), (4.0, 4.15))


def test_the_still_window_ends_with_the_last_burst_before_the_force_rises() -> None:
    rising = {k / 20: 0.01 * (k % 2) + 100 * max(0.0, k / 20 - 3.0) for k in range(121)}
    low, high = still_window(source_of(rising))
    assert low == -math.inf and 2.7 <= high <= 3.1
    with pytest.raises(DataError, match="give --static A,B in seconds"):
        still_window(source_of({}))


def test_the_largest_value_is_read_where_the_other_half_has_its_largest_with_its_sign() -> None:
    first = np.array([[1.0, -3.0], [np.nan, 2.0]])
    assert _largest(first, np.array([[9.0, -2.5], [9.0, 9.0]])) == 2.5
    assert _largest(first, np.array([[9.0, 2.5], [9.0, 9.0]])) == 0.0, "of the other sign it is noise"
    assert _largest(np.full((2, 2), np.nan), first) == 0.0


def test_a_study_along_x_has_the_strains_along_x() -> None:
    from analysis import Roi, StrainField, ZoiGrid

    grid = ZoiGrid.cover(Roi(0, 0, 160, 128), 32, 16)
    loaded = [StrainField.from_values(grid, {"du_dx": 2e-3, "dv_dy": 1e-3}, 1e-5) for _ in range(2)]
    for axis, seen in (("x", 2e-3), ("y", 1e-3)):
        found = _found(StudySetting(32, 16, 1, "gaussian"), axis, [], loaded)
        assert found.seen == pytest.approx(seen) and not found.measured
        assert (found.noise, found.sigma) == (pytest.approx(found.predicted), pytest.approx(found.noise))
        assert found.valid == 1.0
    still = [StrainField.from_values(grid, {"dv_dy": 4e-4}, 1e-5) for _ in range(2)]
    assert _found(StudySetting(32, 16, 1, "gaussian"), "y", still, loaded).seen == pytest.approx(6e-4)


def test_a_table_of_forces_without_a_heading_has_names_or_times(tmp_path: Path) -> None:
    path = tmp_path / "forces.csv"
    path.write_text("a1,5,6\na2,7,8\n", encoding="utf-8")
    with pytest.raises(DataError, match="no force against time or picture under the heading 'a1, 5, 6'"):
        read_forces(path)
    path.write_text("a1,5\na2,-\n", encoding="utf-8")
    found = read_forces(path).export
    assert found.names == ("a1", "a2") and found.times is None
    assert found.forces[0] == 5.0 and math.isnan(found.forces[1])
    path.write_text("Name;Force\n;kN\na1;5,5\n", encoding="utf-8")
    assert read_forces(path).export.forces.tolist() == [5500.0]
    path.write_text("file,force\na1,3\na2\n", encoding="utf-8")
    assert math.isnan(read_forces(path).export.forces[1]), "a row without the cell"
