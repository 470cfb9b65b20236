"""A part of a session: the same bursts as in the whole, and nothing of the rest is read."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquire.burst import BurstAccumulator
from acquire.frame import Frame, frozen
from acquire.session import Session
from live.cli import main
from live.replay.places import burst_ends, places_of_frames
from live.results import Strain

SIZE = "lockstep=yes&seconds=4&fps=10&width=160&height=128&bits=12"
SMALL = ["--zoi", "48", "--step", "24", "--no-view", "--no-rrd"]
RECORDED = {"all": [], "bursts": ["--record", "bursts"], "every": ["--record", "every=3"]}


@pytest.fixture(scope="module", params=RECORDED)
def recorded(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("part") / request.param
    words = ["--burst", "3", "--reference-burst", "3", *RECORDED[request.param], *SMALL]
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
        places, accumulator = places_of_frames(session, 2, 3), BurstAccumulator(3)
        bursts = [burst for frame in session.frames(3) if (burst := accumulator.add(frame))]
    assert places.t.tolist() == [burst.t for burst in bursts]
