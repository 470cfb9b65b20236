"""The response of places from recorded tests of simulated specimens, against their truth."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from acquire.addresses import parse_address
from acquire.session import Session
from hw_mocks.specimen import specimen_from
from live.cli import main
from live.commands.demo import ZoiTruth
from live.results.run_folder import RunFolder, open_run
from live.results.stored_response import StoredResponse
from tests.live.ended import code_of

KINDS = ("uniform", "woven", "hole", "halves")
SIM = "sim:{}?width=208&height=272&seconds=20&fps=20&bits=12&noise=0.1&hole=24&cell=64&lockstep=yes"
ZOIS = ("--roi", "all", "--zoi", "32", "--step", "16")
MEASURE = (*ZOIS, "--burst", "4", "--reference-burst", "16", "--section", "20,2")
QUIET = ("--no-view", "--no-rrd")
Array = NDArray[np.float64]


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a recorded test of each specimen."""
    folder = tmp_path_factory.mktemp("recorded")
    for kind in KINDS:
        camera = SIM.format(kind)
        words = ["run", "--camera", camera, "--load", "sim:", *MEASURE, *QUIET, "--out", str(folder / kind)]
        assert main([*words, *(("--response", "stress") if kind == "halves" else ())]) == 0
    return folder


@pytest.fixture(scope="module")
def replayed(recorded: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Those tests replayed with the response over stress."""
    folder = tmp_path_factory.mktemp("replayed")
    for kind in KINDS:
        session = str(recorded / kind / "session.h5")
        out = str(folder / kind)
        assert main(["replay", session, "--response", "stress", *QUIET, "--out", out]) == 0
    return folder


@pytest.fixture
def run(replayed: Path, request: pytest.FixtureRequest) -> Iterator[RunFolder]:
    with open_run(replayed / request.param) as opened:
        yield opened


def response_in(run: RunFolder) -> StoredResponse:
    assert run.strain.response is not None
    return run.strain.response


def true_compliance(kind: str, run: RunFolder) -> Array:
    """Strain that a ZOI can see over stress, half way through the elastic part."""
    specimen = specimen_from(parse_address(SIM.format(kind)))
    t = 2.0 + 0.5 * (specimen.yield_s - 2.0)
    return ZoiTruth(specimen, run.strain.grid).strains(t)[1] / float(specimen.stress(t))


def test_slopes_are_those_of_the_specimens(replayed: Path) -> None:
    off = []
    for kind in KINDS:
        with open_run(replayed / kind) as run:
            found = response_in(run)
            slope, sigma = found.map("compliance"), found.map("sigma_compliance")
            z = (slope - true_compliance(kind, run)) / sigma
            # A ZOI weighs its pixels by their pattern: where the strain bends within it, that is another strain.
            off.append(z[np.isfinite(z)] if kind in ("uniform", "halves") else z[:0].ravel())
            assert np.nanmedian(found.map("chi2")) == pytest.approx(1, abs=0.08), kind
            assert np.nanmedian(np.abs(z)) < 1.5, kind
    every = np.abs(np.concatenate(off))
    assert 0.60 < np.mean(every < 1) < 0.76
    assert 0.91 < np.mean(every < 2) < 0.985


@pytest.mark.parametrize(("run", "at"), [("uniform", 140.0), ("woven", 140.0)], indirect=["run"])
def test_places_leave_their_lines_together(run: RunFolder, at: float) -> None:
    leaves = response_in(run).map("leaves_at_stress") / 1e6
    known = leaves[np.isfinite(leaves)]
    assert len(known) >= 0.99 * run.strain.grid.n_active
    assert np.median(known) == pytest.approx(at, abs=4)
    assert known.min() > at - 6 and known.max() < at + 12


@pytest.mark.parametrize("run", ["halves"], indirect=True)
def test_two_halves_leave_one_after_the_other(run: RunFolder) -> None:
    found, grid = response_in(run), run.strain.grid
    leaves = found.map("leaves_at_stress") / 1e6
    middle, clear = 135.5, 20.0
    first, second = leaves[grid.y < middle - clear], leaves[grid.y > middle + clear]
    assert np.isfinite(first).all() and np.isfinite(second).mean() > 0.9
    assert np.median(first) == pytest.approx(120, abs=4) and first.min() > 114
    assert np.nanmedian(second) == pytest.approx(160, abs=5) and np.nanmin(second) > 154


def test_a_run_has_the_response_of_its_replay(recorded: Path, replayed: Path) -> None:
    with open_run(recorded / "halves") as own, open_run(replayed / "halves") as again:
        found, other = response_in(own), response_in(again)
        assert found.names == other.names and found.instants == other.instants
        for name in found.names:
            np.testing.assert_allclose(found.map(name), other.map(name), rtol=1e-5, err_msg=name)
    figures = json.loads((recorded / "halves" / "figures.json").read_text())["figures"]
    assert "compliance of the places" in {one["name"] for one in figures}


@pytest.mark.parametrize("run", ["hole"], indirect=True)
def test_a_hole_has_its_amplification(run: RunFolder) -> None:
    compliance = response_in(run).map("compliance") * 70e9
    truth = true_compliance("hole", run) * 70e9
    assert np.corrcoef(compliance[np.isfinite(compliance)], truth[np.isfinite(compliance)])[0, 1] > 0.99


@pytest.mark.parametrize(
    ("channel", "words"), [("mean", "amplification 1"), ("time", "rate"), ("area", "amplif")]
)
def test_other_channels(
    recorded: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], channel: str, words: str
) -> None:
    session, out = str(recorded / "uniform" / "session.h5"), str(tmp_path / "out")
    assert main(["replay", session, "--response", channel, "--gauges", "auto", *QUIET, "--out", out]) == 0
    said = capsys.readouterr().out
    assert f"response over {channel}, " in said and words in said and "VSG" in said


@pytest.fixture(scope="module")
def shots(recorded: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The woven test as a folder of pictures with a file of forces."""
    import cv2

    folder = tmp_path_factory.mktemp("shots")
    specimen = specimen_from(parse_address(SIM.format("woven")))
    lines = ["file,force_N"]
    with Session.open(recorded / "woven" / "session.h5") as session:
        for k, frame in enumerate(session.frames()):
            if k % 6 == 0:
                cv2.imwrite(str(folder / f"shot_{k:04d}.tif"), frame.image)
                lines.append(
                    f"shot_{k:04d}.tif,{float(specimen.force(frame.t - session.start_monotonic)):.3f}"
                )
    (folder / "forces.csv").write_text("\n".join(lines) + "\n")
    return folder


def test_pictures_without_a_load_cell_have_amplifications(shots: Path, tmp_path: Path) -> None:
    source, out = f"files:{shots}/*.tif?bits=12", tmp_path / "out"
    words = [*ZOIS, *QUIET, "--out", str(out)]
    assert main(["replay", source, "--response", "mean", *words]) == 0
    with open_run(out) as run:
        amplification, found = response_in(run).map("amplification"), response_in(run)
        truth = true_compliance("woven", run)
        known = np.isfinite(amplification)
        assert known.mean() > 0.95 and found.instants > 40
        assert np.corrcoef(amplification[known], truth[known])[0, 1] > 0.95


def test_pictures_with_forces_have_compliances(shots: Path, tmp_path: Path) -> None:
    source, out = f"files:{shots}/*.tif?bits=12", tmp_path / "out"
    words = [*ZOIS, "--section", "20,2", *QUIET, "--out", str(out)]
    assert main(["replay", source, "--load", str(shots / "forces.csv"), "--response", "stress", *words]) == 0
    with open_run(out) as run:
        compliance = response_in(run).map("compliance")
        assert np.nanmedian(compliance) == pytest.approx(1 / 70e9, rel=0.05)
        left = np.count_nonzero(response_in(run).map("fate") == 1)
    figures = {one["name"]: one for one in json.loads((out / "figures.json").read_text())["figures"]}
    found = figures["compliance of the places"]
    assert found["value"] == pytest.approx(float(np.nanmedian(compliance))) and found["unit"] == "1/Pa"
    assert found["low"] < found["value"] < found["high"]
    assert figures["places that leave their line"]["value"] == left > 0
    assert 100e6 < figures["leaves_at_stress of the places"]["value"] < 180e6


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (("--response", "stress"), "--response stress needs forces (--load FILE.csv)"),
        (("--response", "notch"), "--response notch: there is no such gauge; give one of stress, mean, time"),
        (("--response", ""), "is empty"),
    ],
)
def test_a_channel_that_is_not_there_is_refused_before_anything_is_written(
    shots: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], more: tuple[str, ...], words: str
) -> None:
    out = tmp_path / "out"
    source = f"files:{shots}/*.tif?bits=12"
    code = code_of(["replay", source, *more, "--roi", "all", "--zoi", "32", *QUIET, "--out", str(out)])
    assert code == 2 and words in capsys.readouterr().err
    assert not out.exists()


def test_few_pictures_say_that_they_do_not_show_where_places_leave(
    shots: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    source = f"files:{shots}/shot_01*.tif?bits=12"
    words = ["replay", source, "--response", "mean", *ZOIS, *QUIET, "--out", str(tmp_path / "out")]
    assert main(words) == 0
    said = capsys.readouterr().out
    assert "where places leave their lines is not known: that takes 25 instants" in said
