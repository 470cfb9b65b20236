"""What the runs in the machine recorded, measured out here with the product's own ``replay``."""

from __future__ import annotations

import csv
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import h5py
import numpy as np
import pytest

from acquire.session.reader import Session
from tests.v4l2.prepare import MEASURED, SHAPE, SHIFT_PX, STRAIN, pictures


@pytest.fixture(scope="module", params=[8, 12])
def bits(request: pytest.FixtureRequest) -> int:
    return int(request.param)


@pytest.fixture(scope="module")
def session_path(kept: Path, bits: int) -> Path:
    return next((kept / f"motion_{bits}").rglob("session.h5"))


@pytest.fixture(scope="module")
def whole(session_path: Path) -> bool:
    """Whether all frames are recorded: a slow machine may have measured some that are not."""
    with Session.open(session_path) as session:
        counts = session.frame_counts
    assert counts is not None
    return not counts["unrecorded"]


@pytest.fixture(scope="module")
def replayed(session_path: Path, whole: bool, bits: int, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """As it was measured; where not all is recorded, what is there."""
    out = tmp_path_factory.mktemp("replay") / f"replayed_{bits}"
    how = ("--as-measured",) if whole else MEASURED
    argv = [sys.executable, "-m", "live.cli", "replay", str(session_path), *how, "--out", str(out)]
    done = subprocess.run([*argv, "--no-view", "--no-rrd"], capture_output=True, text=True, check=False)
    assert done.returncode in (0, 5), done.stdout + done.stderr
    return out


def rows(path: Path) -> list[dict[str, str]]:
    with path.open() as table:
        return list(csv.DictReader(line for line in table if not line.startswith("#")))


@pytest.fixture(scope="module")
def shown(session_path: Path, bits: int, replayed: Path) -> dict[str, np.ndarray]:
    """Which picture each measured burst saw: the number of a row by the name of its picture."""
    known = pictures()
    with Session.open(session_path) as session:
        seen = {int(number): session.frame(k).image for k, number in enumerate(session.indices)}
    names = ("reference", "shifted", "strained")
    found: dict[str, list[int]] = {name: [] for name in names}
    for k, row in enumerate(rows(next(replayed.rglob("strain.csv")))):
        last, count = int(row["last_frame"]), int(row["n_frames"])
        for name in names:
            if all(
                np.array_equal(seen[number], known[f"{name}_{bits}"])
                for number in range(last - count + 1, last + 1)
            ):
                found[name].append(k)
    assert all(found.values()), {name: len(numbers) for name, numbers in found.items()}
    return {name: np.array(numbers) for name, numbers in found.items()}


@pytest.fixture(scope="module")
def strain(replayed: Path) -> Iterator[h5py.Group]:
    with h5py.File(next(replayed.rglob("strain.h5"))) as file:
        yield file["entry/strain"]


@pytest.mark.v4l2
def test_every_recorded_picture_is_one_that_was_shown(session_path: Path, bits: int) -> None:
    known = [image for name, image in pictures().items() if name.endswith(f"_{bits}")]
    with Session.open(session_path) as session:
        frames = list(session.frames())
    assert {frame.image.shape for frame in frames} == {SHAPE}
    strange = [frame.index for frame in frames if not any(np.array_equal(frame.image, one) for one in known)]
    # When the picture changes, the kernel may copy one that is half old and half new.
    assert len(strange) <= 4


@pytest.mark.v4l2
def test_a_known_shift_comes_back(strain: h5py.Group, shown: dict[str, np.ndarray], bits: int) -> None:
    limit = 1e-3 if bits == 8 else 3e-4
    for name, expected in SHIFT_PX.items():
        error = np.nanmean(strain[name][shown["shifted"]]) - expected
        assert abs(error) < limit, f"{name} is wrong by {error:.2e} px"


@pytest.mark.v4l2
def test_a_known_strain_comes_back(strain: h5py.Group, shown: dict[str, np.ndarray], bits: int) -> None:
    # 8 bits without noise: quantisation alone is some 40 um/m in a ZOI of 64 px, 5 in the mean of 70.
    limit = 2e-5 if bits == 8 else 6e-6
    for name, expected in (("exx", STRAIN["du_dx"]), ("eyy", STRAIN["dv_dy"]), ("exy", 0.0)):
        error = np.nanmean(strain[name][shown["strained"]]) - expected
        assert abs(error) < limit, f"{name} is wrong by {error:.2e}"


@pytest.mark.v4l2
def test_the_reference_measures_as_nothing(strain: h5py.Group, shown: dict[str, np.ndarray]) -> None:
    for name in ("exx", "eyy", "exy"):
        assert abs(np.nanmean(strain[name][shown["reference"]])) < 1e-6


@pytest.mark.v4l2
def test_the_force_of_that_instant_stands_beside_it(replayed: Path, shown: dict[str, np.ndarray]) -> None:
    force = np.array([float(row["force_N"]) for row in rows(next(replayed.rglob("strain.csv")))])
    # Medians, since the display changes a little before or after the picture.
    for name, expected in (("reference", 10), ("shifted", 20), ("strained", 30)):
        assert np.nanmedian(force[shown[name]]) == pytest.approx(expected)


@pytest.mark.v4l2
def test_live_inside_and_replay_outside_agree(kept: Path, replayed: Path, whole: bool, bits: int) -> None:
    live, again = (
        {row["last_frame"]: row for row in rows(next(folder.rglob("strain.csv")))}
        for folder in (kept / f"motion_{bits}", replayed)
    )
    common = [number for number in live if number in again]
    assert common
    assert not whole or list(live) == list(again)
    for name in ("exx", "eyy", "exy"):
        a, b = (np.array([float(table[number][name]) for number in common]) for table in (live, again))
        # Not bit-equal: the emulated processor has other instructions.
        assert np.nanmax(np.abs(a - b)) < 1e-6
