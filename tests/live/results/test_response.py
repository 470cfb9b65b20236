"""The response of places: from a file of maps to the group of strain.h5, and back."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.io import loadmat

from acquire.errors import ConfigError, DataError
from analysis.field import Status, StrainField
from analysis.field.grid import ZoiGrid
from live.cli import main
from live.commands.show import playback_messages, view_setup
from live.config.loading import Config, from_dict
from live.pipeline.measurement import Measurement
from live.pipeline.timed.course import ResponseWatch, leaves_name, slope_name
from live.results import Results, ResultsInfo, Strain
from live.results.__main__ import main as probed
from live.results.finished.finished_test import FinishedTest
from live.results.place_response import check_channel, respond, response_lines, response_of, response_title
from live.results.report.report import ReportRequest, make_report
from live.results.run_folder import open_run
from live.results.stored_response import FATE, map_names
from live.ui.rerun.wire import Kind
from live.ui.terminal.screen import TerminalScreen
from tests.live.made_run import CONFIG, UTC_START
from tests.live.made_up import CAMERA, START, make_grid, make_measurement

E_PA, NU, SIGMA, REFERENCE_SIGMA, AREA_M2 = 70e9, 0.3, 30e-6, 20e-6, 20e-6
STILL, RAMP = 8, 140
STRAINS = np.concatenate([np.zeros(STILL), np.linspace(2e-5, 2.8e-3, RAMP)])
Array = NDArray[np.float64]
LOST = (1, 2)


def amplified(grid: ZoiGrid) -> Array:
    """True amplification of each place."""
    rows, columns = np.indices(grid.shape)
    return np.asarray(1 + 0.2 * np.sin(rows + 2.0 * columns))


def field_of(grid: ZoiGrid, number: int, strain: float, extra: Array) -> StrainField:
    """Places strained by their amplification and ``extra``, with noise of the picture and of the reference."""
    rng, reference = np.random.default_rng(number), np.random.default_rng(999)
    eyy = amplified(grid) * strain + extra
    truth = {"dv_dy": eyy, "du_dx": -NU * eyy}
    values = {
        name: truth[name]
        + rng.normal(0, SIGMA, grid.shape)
        + reference.normal(0, REFERENCE_SIGMA, grid.shape)
        for name in ("dv_dy", "du_dx")
    }
    x, y = np.meshgrid(grid.x - grid.x.mean(), grid.y - grid.y.mean())
    values |= {"u": -NU * strain * x, "v": strain * y}
    status = np.where(grid.active, Status.OK, Status.NOT_MEASURED)
    if number > 100:
        status[LOST] = Status.LOST
    sigma = float(np.hypot(SIGMA, REFERENCE_SIGMA))
    field = StrainField.from_values(grid, values, sigma, status=status)
    share = np.float32((REFERENCE_SIGMA / sigma) ** 2)
    return StrainField(
        grid, field.parameters, field.covariance, field.covariance * share, field.residual, field.status,
        field.iterations, field.gain,
    )  # fmt: skip


def make_folder(
    folder: Path, channel: str, knee: float = np.inf, loads: bool = True, **specimen: float
) -> Path:
    """A test in which the places of the upper half flow from ``knee`` on, a stress in Pa."""
    grid = make_grid()
    upper = np.indices(grid.shape)[0] < 2
    config = CONFIG | {"specimen": CONFIG["specimen"] | specimen}
    info = ResultsInfo(
        START,
        UTC_START.isoformat(),
        config,
        {},
        {},
        CAMERA,
        "small",
        AREA_M2 if loads else None,
        response=channel,
    )
    with Results(folder, grid, info) as results:
        for k, strain in enumerate(STRAINS):
            stress = E_PA * strain
            extra = np.where(upper, np.maximum(stress - knee, 0) / 15e9, 0.0)
            force = stress * AREA_M2 if loads else np.nan
            field = field_of(grid, k, strain, extra)
            results.add(Measurement.of(k, make_measurement(k, strain).burst, field, force))
    return folder


def evaluated(folder: Path, channel: str) -> None:
    with open_run(folder) as run:
        figures = FinishedTest.of_folder(run).figures
    respond(folder, figures, channel)


@pytest.fixture(scope="module")
def stressed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = make_folder(tmp_path_factory.mktemp("stressed"), "stress", knee=120e6)
    evaluated(folder, "stress")
    return folder


@pytest.fixture
def strain(stressed: Path) -> Iterator[Strain]:
    with Strain.open(stressed / "strain.h5") as opened:
        yield opened


def test_compliance_and_where_places_leave(strain: Strain) -> None:
    found = strain.response
    assert found is not None
    slope, sigma = found.map("compliance"), found.map("sigma_compliance")
    off = (slope - amplified(strain.grid) / E_PA) / sigma
    assert np.abs(off[np.isfinite(off)]).max() < 4.5
    assert np.sqrt(np.nanmean(off**2)) == pytest.approx(1, abs=0.35)
    assert np.nanmean(found.map("chi2")) == pytest.approx(1, abs=0.1)
    poisson = (found.map("poisson") - NU) / found.map("sigma_poisson")
    assert np.sqrt(np.nanmean(poisson**2)) == pytest.approx(1, abs=0.35)
    at, fate = found.map("leaves_at_stress"), found.map(FATE)
    upper = (np.indices(strain.grid.shape)[0] < 2) & strain.grid.active
    gone = np.zeros(strain.grid.shape, bool)
    gone[LOST] = True
    assert at[upper & ~gone] == pytest.approx(120e6, abs=6e6)
    assert np.isnan(at[~upper]).all() and (fate[~upper & strain.grid.active] == 0).all()
    assert (fate[upper & ~gone] == 1).all()
    assert found.channel == "stress" and found.common == 0
    assert found.first >= 7e6 and found.last == pytest.approx(E_PA * STRAINS[-1], rel=0.02)


def test_the_maps_are_among_those_of_the_file(strain: Strain) -> None:
    assert strain.whole_names == map_names("stress")
    assert not set(strain.whole_names) & set(strain.names)
    whole = strain.maps("compliance")
    assert whole.shape == (len(STRAINS), *strain.grid.shape)
    np.testing.assert_array_equal(whole[3], strain.maps("compliance", 5))
    with pytest.raises(DataError, match="no row 999"):
        strain.maps("compliance", 999)
    with pytest.raises(DataError, match=r"no map 'amplification'; there are u, v, .* fate"):
        strain.maps("amplification", 0)


def test_units_and_meanings_are_in_the_file(stressed: Path) -> None:
    with h5py.File(stressed / "strain.h5") as file:
        group = file["entry/response"]
        assert group.attrs["NX_class"] == b"NXdata" and group.attrs["signal"] == b"compliance"
        units = {name: group[name].attrs["units"] for name in map_names("stress")}
        assert (
            units["compliance"] == units["sigma_compliance"] == "1/Pa" and units["leaves_at_stress"] == "Pa"
        )
        assert group["chi2"].attrs["long_name"].startswith("variance left by the line")
        assert group["x"] == file["entry/strain/x"]
        share = SIGMA**2 / (SIGMA**2 + REFERENCE_SIGMA**2)
        np.testing.assert_allclose(group["current"], share, rtol=1e-3)


def test_a_lost_place_has_not_left_its_line(tmp_path: Path) -> None:
    folder = make_folder(tmp_path, "stress")
    evaluated(folder, "stress")
    with Strain.open(folder / "strain.h5") as strain:
        assert strain.response is not None
        fate = strain.response.map(FATE)
        assert fate[LOST] == 2 and (np.delete(fate[strain.grid.active], 0) != 1).all()
        assert strain.response.map("instants")[LOST] < strain.response.instants
        assert np.isnan(fate[~strain.grid.active]).all()
        assert response_lines(strain)[1].endswith("places leave their line; lost before: 1")


@pytest.mark.parametrize("loads", [True, False])
def test_amplification_needs_no_load(tmp_path: Path, loads: bool) -> None:
    folder = make_folder(tmp_path, "mean", loads=loads)
    evaluated(folder, "mean")
    with Strain.open(folder / "strain.h5") as strain:
        found = strain.response
        assert found is not None and found.last == pytest.approx(2.8e-3, rel=0.15)
        truth = amplified(strain.grid)
        mean = float(np.nanmean(strain.values["eyy"][-20:] / STRAINS[-20:]))
        off = (found.map("amplification") - truth / mean) / found.map("sigma_amplification")
        # The place that was lost changes the mean, and with it all the others a little.
        assert np.nanmedian(np.abs(off)) < 1.5
        assert np.isnan(found.map("leaves_at_strain")).all()
        assert response_title(strain, "amplification").startswith("amplification over mean, ")
        assert response_title(strain, "eyy") == ""


@pytest.mark.parametrize("channel", ["stress", "mean", "time"])
def test_a_test_that_goes_on_has_the_lines_so_far(channel: str) -> None:
    watch, grid = ResponseWatch(), make_grid()
    watch.channel, watch.area_m2 = channel, AREA_M2
    assert not watch.maps()
    upper, knee = np.indices(grid.shape)[0] < 2, 120e6 if channel == "stress" else np.inf
    means = []
    for k, strain in enumerate(STRAINS):
        extra = np.where(upper, np.maximum(E_PA * strain - knee, 0) / 15e9, 0.0)
        burst, field = make_measurement(k, strain).burst, field_of(grid, k, strain, extra)
        m = Measurement.of(k, burst, field, E_PA * strain * AREA_M2)
        means.append(m.time_step.eyy)
        for _ in range(1 if channel == "time" else 2):
            watch.add(m, "y")  # over a load, a burst that is no higher than those before does not count
    maps, name = watch.maps(), slope_name(channel)
    of = {"stress": E_PA * STRAINS, "mean": means, "time": 0.1 * np.arange(len(STRAINS))}
    truth = amplified(grid) * np.polyfit(of[channel], STRAINS, 1)[0]
    seen = np.isfinite(maps[name])
    assert seen.sum() == grid.n_active
    seen[LOST] = channel != "time"  # its line is of another part of a course that bends
    off = ((maps[name] - truth) / maps[f"sigma_{name}"])[seen]
    assert np.abs(off).max() < 4.5 and np.sqrt(np.mean(off**2)) == pytest.approx(1, abs=0.35)
    gone = np.isfinite(maps.get(leaves_name(channel), np.full(grid.shape, np.nan)))
    if channel == "stress":
        assert np.nanmean(maps["chi2"]) == pytest.approx(1, abs=0.1)
        assert gone[upper & grid.active].sum() >= 12 and not gone[~upper].any()
        assert maps["leaves_at_stress"][gone] == pytest.approx(120e6, abs=6e6)
    else:
        assert not gone.any()


@pytest.mark.parametrize(
    ("channel", "words"),
    [("stress", "all together ± 0.58 %"), ("mean", " % of the distance from 1; chi2")],
)
def test_what_comes_with_the_load_stands_beside(tmp_path: Path, channel: str, words: str) -> None:
    stated = {"force_error_percent": 1.0} if channel == "stress" else {"strain_error_um_m": 20.0}
    folder = make_folder(tmp_path, channel, knee=120e6, **stated)
    evaluated(folder, channel)
    with Strain.open(folder / "strain.h5") as strain:
        assert words in response_lines(strain)[0]


def test_rate_over_time(tmp_path: Path) -> None:
    folder = make_folder(tmp_path, "time")
    evaluated(folder, "time")
    with Strain.open(folder / "strain.h5") as strain:
        found = strain.response
        assert found is not None and found.instants == len(STRAINS) and "leaves_at_strain" not in found.names
        seconds = strain.time_s
        slope = np.polyfit(seconds, STRAINS, 1)[0]
        known = np.isfinite(found.map("rate")) & (found.map("instants") == found.instants)
        expected = (slope * amplified(strain.grid))[known]
        np.testing.assert_allclose(found.map("rate")[known], expected, rtol=0.02)
        assert len(response_lines(strain)) == 1 and "µm/m/s" in response_lines(strain)[0]


def test_a_file_that_was_left_before_the_end_is_one_without(tmp_path: Path) -> None:
    folder = make_folder(tmp_path, "stress")
    with Strain.open(folder / "strain.h5") as strain:
        assert strain.response is None and strain.whole_names == () and response_lines(strain) == []


def test_too_few_instants_are_told(tmp_path: Path) -> None:
    grid = make_grid()
    info = ResultsInfo(
        START, UTC_START.isoformat(), CONFIG, {}, {}, CAMERA, "small", AREA_M2, response="stress"
    )
    with Results(tmp_path, grid, info) as results:
        for k in range(3):
            results.add(make_measurement(k, 0.0))
    with open_run(tmp_path) as run:
        figures = FinishedTest.of_folder(run).figures
    (line,), none = response_of(tmp_path, figures, "stress")
    assert none == []
    assert line.startswith("no response over stress: the load rises at ")


DAMAGED: dict[str, tuple[Callable[[h5py.Group], Any], str]] = {
    "another shape": (lambda g: _put(g, "chi2", np.zeros((2, 2), "f4")), "chi2 is float32"),
    "another type": (lambda g: _put(g, "fate", np.zeros((5, 7), "u1")), "fate is uint8"),
    "a map missing": (lambda g: g.__delitem__("compliance"), "compliance is missing"),
    "a link": (lambda g: _put(g, "chi2", h5py.ExternalLink("/etc/passwd", "x")), "is a link"),
    "another channel": (lambda g: g.attrs.__setitem__("channel", "mean"), "amplification is missing"),
    "no strain": (lambda g: g.attrs.__setitem__("strain", "\x1b[31m"), "strain is"),
    "instants below none": (lambda g: g.attrs.__setitem__("instants", np.int64(-1)), "@instants is -1"),
    "a text for a number": (lambda g: g.attrs.__setitem__("common", "much"), "@common is"),
}


def _put(group: h5py.Group, name: str, value: Any) -> None:
    del group[name]
    group[name] = value


@pytest.mark.parametrize("case", DAMAGED)
def test_a_damaged_group_is_refused(stressed: Path, tmp_path: Path, case: str) -> None:
    change, words = DAMAGED[case]
    path = tmp_path / "strain.h5"
    path.write_bytes((stressed / "strain.h5").read_bytes())
    with h5py.File(path, "r+") as file:
        change(file["entry/response"])
    with pytest.raises(DataError, match=words) as caught:
        Strain.open(path)
    assert "\x1b" not in str(caught.value)


def test_a_group_that_is_a_dataset_is_refused(stressed: Path, tmp_path: Path) -> None:
    path = tmp_path / "strain.h5"
    path.write_bytes((stressed / "strain.h5").read_bytes())
    with h5py.File(path, "r+") as file:
        del file["entry/response"]
        file["entry/response"] = 1
    with pytest.raises(DataError, match="is not a group"):
        Strain.open(path)


def test_the_child_that_probes_reads_it_too(stressed: Path) -> None:
    assert probed(str(stressed / "strain.h5")) == 0


@pytest.mark.parametrize(
    ("channel", "area", "forces", "words"),
    [
        ("stress", None, True, "needs a section"),
        ("stress", 20.0, False, "needs forces"),
        ("notch", 20.0, True, "give one of stress, mean, time, web"),
    ],
)
def test_a_channel_that_will_not_be_is_refused(
    channel: str, area: float | None, forces: bool, words: str
) -> None:
    plain = {"specimen": {"area_mm2": area}, "gauges": {"web": {"kind": "zoi", "at": [1, 2]}}}

    def over(name: str | None) -> Config:
        return from_dict(plain | {"output": {"response": name} if name else {}}, {}, "made up")

    with pytest.raises(ConfigError, match=words):
        check_channel(over(channel), forces=forces)
    for known in (None, "mean", "time", "web"):
        check_channel(over(known), forces=forces)


@pytest.mark.parametrize("kind", ["csv", "npz", "mat", "vtk", "png"])
def test_exports_hold_the_maps_once(stressed: Path, tmp_path: Path, kind: str) -> None:
    out = tmp_path / "out"
    fields = "compliance" if kind == "png" else "response"
    assert main(["export", str(stressed), "--to", kind, "--fields", fields, "--out", str(out)]) == 0
    with Strain.open(stressed / "strain.h5") as strain:
        compliance, active = strain.maps("compliance", 0), strain.grid.active
    if kind == "csv":
        lines = [line for line in out.read_text(encoding="utf-8").splitlines() if line[0] != "#"]
        heads, *rows = (line.split(",") for line in lines)
        assert {"compliance_per_Pa", "leaves_at_stress_Pa", "fate"} <= {*heads} and len(rows) == active.sum()
        values = [float(row[heads.index("compliance_per_Pa")]) for row in rows]
        np.testing.assert_allclose(values, compliance[active], rtol=1e-6)
        assert "# response over stress, " in out.read_text(encoding="utf-8")
    elif kind == "npz":
        with np.load(out) as arrays:
            assert arrays["compliance"].shape == (1, *compliance.shape)
            np.testing.assert_array_equal(arrays["compliance"][0], compliance)
    elif kind == "mat":
        np.testing.assert_array_equal(loadmat(out)["compliance"][..., 0], compliance)
    else:
        names = sorted(path.name for path in out.iterdir())
        assert names == (["compliance_00000.png"] if kind == "png" else ["strain.pvd", "strain_00000.vti"])


def test_wide_tables_have_names_that_files_may_have(stressed: Path, tmp_path: Path) -> None:
    words = ["export", str(stressed), "--to", "csv", "--layout", "wide", "--fields", "response"]
    assert main([*words, "--out", str(tmp_path / "wide")]) == 0
    assert (tmp_path / "wide" / "compliance_per_Pa.csv").is_file()


def test_all_maps_are_those_of_instants(stressed: Path, tmp_path: Path) -> None:
    out = tmp_path / "all.npz"
    assert main(["export", str(stressed), "--to", "npz", "--fields", "all", "--out", str(out)]) == 0
    with np.load(out) as arrays:
        assert "compliance" not in arrays and len(arrays["eyy"]) == len(STRAINS)


def test_a_map_is_drawn_with_what_it_is_from(stressed: Path, tmp_path: Path) -> None:
    picture = tmp_path / "map.png"
    assert main(["map", str(stressed), str(picture), "--field", "leaves_at_stress"]) == 0
    assert picture.stat().st_size > 1000


def test_the_report_shows_the_maps(stressed: Path, tmp_path: Path) -> None:
    with open_run(stressed) as run:
        html = make_report(run, ReportRequest(), TerminalScreen(quiet=True)).html
        plain = make_folder(tmp_path, "")
    _, _, after = html.partition("<h2>Response of each place</h2>")
    part = after.partition("</section>")[0]
    assert part.count("<img ") == 5 and "compliance over stress, " in part and "VSG" in part
    assert "places leave their line at 1" in part
    with open_run(plain) as run:
        assert (
            "Response of each place" not in make_report(run, ReportRequest(), TerminalScreen(quiet=True)).html
        )


def test_the_view_of_a_finished_run_has_the_maps(stressed: Path) -> None:
    with open_run(stressed) as run:
        setup = view_setup(run)
        messages = list(playback_messages(run, (0, 50)))
        assert setup.whole == tuple(n for n in map_names("stress") if n not in (FATE, "instants"))
        (whole,) = (message for message in messages if message.kind is Kind.WHOLE)
        assert {*setup.whole} <= {*whole.arrays}
        np.testing.assert_array_equal(whole.arrays["compliance"], run.strain.maps("compliance", 0))
        status = next(message for message in messages if message.kind is Kind.STATUS)
        assert "response over stress" in status.meta["markdown"]
