"""Replay: prefetch, memory, the results of an older recording, and parts of a session.

``recorded/session.h5`` was recorded by ``phasedic run`` on the simulated rig (sim:woven, 144 x 112 px,
8 bit, 10 fps, bursts of 2) with an earlier version; ``strain.npz`` is the result of its replay --as-measured
then. The last bits depend on the processor, the version of numba and that of the loops.
"""

from __future__ import annotations

import gc
import json
import math
import shutil
import threading
import time
from collections.abc import Iterator, Mapping
from importlib import import_module
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquire.burst import BurstAccumulator
from acquire.clock import ClockPair
from acquire.frame import Burst, CameraInfo, Frame, frozen
from acquire.load_cell import LoadLog
from acquire.session import Session
from analysis import numerics
from live.cli import main
from live.config.loading import Config, load_config
from live.pipeline.consumer import Screen
from live.pipeline.measure import Tracker
from live.replay.burst_index import burst_ends, index_of_frames
from live.replay.opening import prepare_replay
from live.replay.source import ReplaySource, prefetch
from live.results import Strain
from live.setup.region import FirstLook
from tests.live.ui.waiting import LONG_S, until

LAST_DIGITS = 0.05
"""Of a sigma: what ZOIs that share a warp may differ by from those that had one each (docs/method.md)."""


def test_the_same_items_in_order() -> None:
    assert list(prefetch(range(100), queue_size=3)) == list(range(100))
    assert list(prefetch([])) == []


def test_they_are_taken_while_one_is_worked_on_but_no_more_than_there_is_room() -> None:
    taken, waiting = [], threading.Event()

    def items() -> Iterator[int]:
        for k in range(20):
            taken.append(k)
            if k == 4:
                waiting.set()
            yield k

    bursts = prefetch(items(), queue_size=3)
    assert next(bursts) == 0
    assert waiting.wait(LONG_S), "nothing was read ahead"
    assert max(taken) <= 5
    bursts.close()


def test_an_error_comes_after_what_was_well() -> None:
    def items() -> Iterator[int]:
        yield 1
        yield 2
        raise OSError("the disk is gone")

    bursts = prefetch(items())
    assert [next(bursts), next(bursts)] == [1, 2]
    with pytest.raises(OSError, match="the disk is gone"):
        next(bursts)


def test_closing_it_ends_the_thread_and_the_source() -> None:
    before = set(threading.enumerate())

    def items() -> Iterator[int]:
        while True:
            yield 0

    bursts = prefetch(items(), queue_size=2)
    next(bursts)
    bursts.close()
    assert set(threading.enumerate()) <= before


NEEDED = 5
"""The reference, the one measured, the one before (it may become the reference), one that waits, one at hand."""


def bursts() -> list[Burst]:
    """All there are."""
    return [one for one in gc.get_objects() if isinstance(one, Burst)]


@pytest.mark.slow
def test_bursts_are_let_go_of(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    size = "lockstep=yes&seconds=2&fps=10&width=160&height=128&bits=12"
    words = ["--zoi", "48", "--step", "24", "--burst", "2", "--no-view", "--no-rrd"]
    run = ["run", "--camera", f"sim:uniform?{size}", "--load", "sim:", "--reference-burst", "2"]
    assert main([*run, *words, "--out", str(tmp_path / "run")]) == 0
    kept: list[int] = []
    measured = Tracker.measure

    def measure(tracker: Tracker, burst: Burst) -> Any:
        if len(kept) == 4:  # once all is read that can be; then one too many has time to come
            until(lambda: len(bursts()) - len(others) >= NEEDED)
            time.sleep(0.3)
        kept.append(len(bursts()) - len(others))
        return measured(tracker, burst)

    def nobody_wants_it(burst: Burst) -> None:
        raise AssertionError("a picture was made for a view that is not there")

    monkeypatch.setattr(Tracker, "measure", measure)
    monkeypatch.setattr(import_module("live.replay.replay"), "picture_of", nobody_wants_it)
    gc.collect()
    others = bursts()  # of other tests
    assert (
        main(["replay", str(tmp_path / "run" / "session.h5"), *words, "--out", str(tmp_path / "again")]) == 0
    )
    assert len(kept) > 5
    assert kept[4] == NEEDED


RECORDED = Path(__file__).with_name("recorded")


def as_recorded(folder: Path, then: Mapping[str, np.ndarray], name: str) -> None:
    """A map is within its last digits of what an earlier version wrote; uncertainties are within 1 %."""
    with h5py.File(folder / "strain.h5") as file:
        now = file["entry/strain"][name][()]
    sigma = then.get(f"sigma_{name}", np.abs(then[name]))
    np.testing.assert_allclose(
        (now - then[name]) / np.where(sigma > 0, sigma, 1), 0, atol=LAST_DIGITS, err_msg=name
    )


def test_an_old_session_gives_the_same_strain(tmp_path: Path) -> None:
    out, session = tmp_path / "again", str(RECORDED / "session.h5")
    assert main(["replay", session, "--as-measured", "--out", str(out), "--no-view", "--no-rrd"]) == 0
    then = np.load(RECORDED / "strain.npz")
    for name in set(then.files) - {"cpu", "iterations"}:
        as_recorded(out, then, name)


def write_json(path: Path, name: str, value: dict[str, Any]) -> None:
    with h5py.File(path, "r+") as file:
        del file["entry"][name]
        file["entry"][name] = np.bytes_(json.dumps(value))


def test_a_session_whose_bursts_were_shortened_replays(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Earlier versions could fit the length of a burst to the motion; a replay of all frames no longer does."""
    path = tmp_path / "session.h5"
    shutil.copy(RECORDED / "session.h5", path)
    with h5py.File(path) as file:
        config = json.loads(file["entry/config"][()])
    config["measure"]["shorten_bursts"] = True
    write_json(path, "config", config)
    command = ["replay", str(path), "--no-view", "--no-rrd", "--out"]
    assert main([*command, str(tmp_path / "all")]) == 0
    assert "the run shortened its bursts" in capsys.readouterr().out
    assert main([*command, str(tmp_path / "same"), "--as-measured"]) == 0
    assert "shortened" not in capsys.readouterr().out
    as_recorded(tmp_path / "same", np.load(RECORDED / "strain.npz"), "eyy")


def test_a_replay_says_where_the_last_digits_may_differ(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Elsewhere processor, vectors or loops are others; what was not written down then is not told."""
    path = tmp_path / "session.h5"
    shutil.copy(RECORDED / "session.h5", path)
    command = ["replay", str(path), "--as-measured", "--no-view", "--no-rrd", "--out"]
    write_json(path, "versions", {"vectors": "4 float32", "loops": "\x1b[31m"})
    assert main([*command, str(tmp_path / "other")]) == 0
    told = capsys.readouterr().out
    assert (
        "recorded with vectors 4 float32 (here" in told
        and "the last digits of the results may differ" in told
    )
    assert "\x1b" not in told
    write_json(path, "versions", numerics())
    assert main([*command, str(tmp_path / "same")]) == 0
    assert "vectors" not in capsys.readouterr().out


SIZE = "lockstep=yes&seconds=4&fps=10&width=160&height=128&bits=12"
SMALL = ["--zoi", "48", "--step", "24", "--no-view", "--no-rrd"]
RECORDED_PART_OF_A_SESSION = {"all": [], "bursts": ["--record", "bursts"], "every": ["--record", "every=3"]}


@pytest.fixture(scope="module", params=RECORDED_PART_OF_A_SESSION)
def recorded(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("part") / request.param
    words = ["--burst", "3", "--reference-burst", "3", *RECORDED_PART_OF_A_SESSION[request.param], *SMALL]
    assert main(["run", "--camera", f"sim:uniform?{SIZE}", "--load", "sim:", *words, "--out", str(out)]) == 0
    return out / "session.h5"


def replayed(session: Path, out: Path, *words: str) -> Strain:
    assert main(["replay", str(session), *words, *SMALL, "--out", str(out)]) == 0
    return Strain.open(out / "strain.h5")


@pytest.mark.parametrize("mode", [[], ["--as-measured"]])
def test_the_bursts_are_those_of_the_whole(recorded: Path, tmp_path: Path, mode: list[str]) -> None:
    if mode and recorded.parent.name == "every":
        pytest.skip("has not the bursts of the run")
    more = ["--burst", "1"] if recorded.parent.name == "every" else []
    with replayed(recorded, tmp_path / "whole", *mode, *more) as whole:
        low, high = (float(whole.time_s[k]) for k in (3, 6))
        names = ("time_s", "frame", "last_frame", "lost", "noise_GL", "force_N")
        wanted = {name: whole.values[name][3:7] for name in names}
        eyy = whole.maps("eyy")[3:7]
    between = ["--from", f"{low - 1e-6}", "--to", f"{high + 1e-6}"]
    with replayed(recorded, tmp_path / "part", *mode, *more, *between) as part:
        for name, values in wanted.items():
            np.testing.assert_array_equal(part.values[name], values, err_msg=name)
        np.testing.assert_allclose(part.maps("eyy"), eyy, atol=2e-5)


@pytest.mark.parametrize("mode", [[], ["--as-measured"]])
def test_nothing_before_and_after_is_read(
    recorded: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, mode: list[str]
) -> None:
    if mode and recorded.parent.name == "every":
        pytest.skip("has not the bursts of the run")
    read: list[int] = []
    for name in ("frame", "burst"):
        was = getattr(Session, name)
        monkeypatch.setattr(Session, name, lambda session, k, was=was: (read.append(k), was(session, k))[1])
    more = ["--burst", "1"] if recorded.parent.name == "every" else []
    with Session.open(recorded) as session:
        number = len(session) or session.burst_count
    words = ["--from", "1.9", "--to", "2.4", *mode, *more]
    with replayed(recorded, tmp_path / "part", *words) as part:
        assert 1 <= len(part.time_s) <= 6
    assert len(set(read)) < number / 2


def test_the_last_is_told_where_none_lies_within(recorded: Path, capsys: pytest.CaptureFixture[str]) -> None:
    more = ["--burst", "1"] if recorded.parent.name == "every" else []
    assert main(["replay", str(recorded), "--from", "100", *more, *SMALL, "--out", "none"]) == 4
    assert "no burst lies between --from and --to; the last one is at 3." in capsys.readouterr().err


FRAMES = st.lists(st.tuples(st.integers(1, 2), st.integers(0, 1), st.booleans()), max_size=40)


@given(FRAMES, st.integers(1, 4))
def test_the_table_tells_what_the_accumulator_does(frames: list[tuple[int, int, bool]], n: int) -> None:
    index = np.cumsum([step for step, _, _ in frames]).tolist() if frames else []
    lost, damaged = [lost for _, lost, _ in frames], [bad for _, _, bad in frames]
    accumulator, ends = BurstAccumulator(n), []
    image = frozen(np.zeros((3, 3), np.uint8))
    for row, (number, gap, bad) in enumerate(zip(index, lost, damaged, strict=True)):
        frame = Frame(image, number, float(row), "nominal", gap, 8, math.nan, damaged=bad)
        if accumulator.add(frame) is not None:
            ends.append(row + 1)
    assert burst_ends(index, lost, damaged, n) == ends


def test_times_are_those_of_the_bursts(recorded: Path) -> None:
    if recorded.parent.name != "all":
        pytest.skip("has no frames in a row")
    with Session.open(recorded) as session:
        places, accumulator = index_of_frames(session, 2, 3), BurstAccumulator(3)
        bursts = [burst for frame in session.frames(3) if (burst := accumulator.add(frame))]
    assert places.t.tolist() == [burst.t for burst in bursts]


@pytest.mark.parametrize(
    ("n", "noise", "of_mean"), [(16, 2.0, 0.5), (1, math.nan, None), (4, 0.0, None), (4, 0.01, 12**-0.5 / 2)]
)
def test_a_specimen_is_looked_for_with_the_noise_of_the_mean_of_its_reference(
    monkeypatch: pytest.MonkeyPatch, n: int, noise: float, of_mean: float | None
) -> None:
    class Seen(Exception):
        """What ends the preparation."""

    def look(_config: Config, first: FirstLook, _print: object) -> None:
        raise Seen(first.noise)

    monkeypatch.setattr("live.replay.opening.located_on", look)
    image = frozen(np.zeros((64, 64), np.float32))
    reference = Burst(image, n, noise, frozen(image > 0), 8, 0.0, 0.0, 0, n - 1, 0, "nominal")
    camera = CameraInfo("files:", "files", 64, 64, 8, live=False, clock="nominal")
    source = ReplaySource(camera, reference, [], LoadLog(), ClockPair.now())
    config = load_config(None, {"camera.address": "files:", "measure.roi": "auto"})
    with pytest.raises(Seen) as seen:
        prepare_replay(source, config, "a test", Screen())
    assert seen.value.args == (pytest.approx(of_mean) if of_mean else None,)
