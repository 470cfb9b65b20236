"""``phasedic study``: the predicted noise, the strains, and the recommended setting."""

from __future__ import annotations

import csv
import math
from pathlib import Path

import numpy as np
import pytest

from acquire.errors import ConfigError
from analysis import Roi, StrainField, ZoiGrid
from live.cli import main
from live.config.loading import load_config
from live.replay.study import StudyResult, StudySetting, _found, recommended
from live.results.report import saving

SIZE = "lockstep=yes&seconds=6&fps=10&width=320&height=288&bits=12&hole=24&hold=2&end=1"
PLAIN = ["--reference-burst", "6", "--burst", "2", "--zoi", "32", "--step", "16", "--no-view", "--no-rrd"]


def recorded(folder: Path, kind: str, load: str = "sim:") -> Path:
    camera = f"sim:{kind}?{SIZE}"
    assert main(["run", "--camera", camera, "--load", load, *PLAIN, "--out", str(folder / kind)]) == 0
    return folder / kind / "session.h5"


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return recorded(tmp_path_factory.mktemp("study"), "hole")


@pytest.fixture
def no_browser(monkeypatch: pytest.MonkeyPatch) -> None:
    """Figures without PNG, which take a second of a browser."""
    monkeypatch.setattr(saving, "find_browser", lambda: None)


def rows(out: Path) -> list[dict[str, float]]:
    lines = (out / "study.csv").read_text(encoding="utf-8").splitlines()
    return [{k: float(v) for k, v in row.items() if k != "window"} for row in csv.DictReader(lines)]


@pytest.mark.slow
def test_of_a_hole(session: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "study"
    assert main(["study", str(session), "--zoi", "24,32,64", "--roi", "all", "--out", str(out)]) == 0
    small, middle, large = found = rows(out)
    assert all(row["noise"] / row["predicted"] == pytest.approx(1, abs=0.1) for row in found)
    # The strain beside a hole is concentrated: small ZOIs show more of it, with more noise.
    assert small["seen"] > 1.1 * large["seen"] > 0.008
    assert small["noise"] > 1.5 * middle["noise"] > 3 * large["noise"]
    assert [row["step"] for row in found] == [6, 8, 16]
    chosen = load_config(out / "measure.toml", {}).measure
    printed = capsys.readouterr().out
    assert f"take {chosen.zoi} px ZOIs, step {chosen.step}" in printed
    assert chosen.zoi < 64
    kinds = (".svg", ".png") if saving.find_browser() else (".svg",)
    for kind in kinds:
        assert {path.stem for path in (out / "figures").glob(f"*{kind}")} == {"noise", "strain"}


@pytest.mark.usefixtures("no_browser")
def test_windows_given_and_missing(session: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["study", str(session), "--zoi", "48", "--roi", "all", "--out", str(tmp_path / "a")]
    assert main([*words, "--static", "0,2", "--loaded", "5,5.9"]) == 0
    printed = capsys.readouterr().out
    assert (
        "\nsettings: 1; " in f"\n{printed}" and "it alone shows at least 95% of the largest strain" in printed
    )
    assert main(words) == 2
    assert "exists already" in capsys.readouterr().err
    words[-1] = str(tmp_path / "b")
    assert main([*words, "--loaded", "100,101"]) == 4
    assert "0 bursts from 100 to 101 s, 2 are needed; give --loaded" in capsys.readouterr().err
    assert not (tmp_path / "b").exists()


def test_a_browser_that_does_not_work_costs_the_png_alone(
    session: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """It lost table and recommendation of a whole study."""
    browser = tmp_path / "chromium"
    browser.write_text("#!/bin/sh\necho no display here >&2\nexit 1\n")
    browser.chmod(0o755)
    monkeypatch.setattr(saving, "find_browser", lambda: str(browser))
    out = tmp_path / "study"
    assert main(["study", str(session), "--zoi", "48,64", "--roi", "all", "--out", str(out)]) == 0
    printed = capsys.readouterr().out
    assert f"SVG and CSV without PNG: {browser} failed on noise.svg (no display here)" in printed
    assert "px ZOIs, step" in printed and "Traceback" not in printed
    assert len(rows(out)) == 2 and (out / "measure.toml").exists()
    assert {path.suffix for path in (out / "figures").iterdir()} == {".svg", ".csv"}


@pytest.mark.usefixtures("no_browser")
def test_without_a_force(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    session = recorded(tmp_path, "uniform", "none:")
    words = ["study", str(session), "--zoi", "32,64", "--roi", "all", "--out", str(tmp_path / "a")]
    assert main(words) == 4
    assert "there is no force" in capsys.readouterr().err
    assert main([*words, "--static", "0,1.5", "--loaded", "5,6"]) == 0
    assert "take 64 px ZOIs" in capsys.readouterr().out  # the strain is even


@pytest.mark.usefixtures("no_browser")
def test_nothing_was_still(session: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The predicted noise stands in the place of the measured one."""
    out = tmp_path / "study"
    words = ["study", str(session), "--zoi", "24,64", "--roi", "all", "--static", "none", "--out", str(out)]
    assert main(words) == 0
    assert ": 0 still, 6 loaded\n" in capsys.readouterr().out
    small, large = rows(out)
    assert all(row["noise"] == row["predicted"] for row in (small, large))
    assert small["seen"] > 1.1 * large["seen"] > 0.008


@pytest.mark.slow
@pytest.mark.data
@pytest.mark.usefixtures("no_browser")
def test_the_open_hole(data_dir: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """What docs/scale.md says of it; its pictures 04 and 07, which are elastic."""
    shots = f"files:{data_dir}/dic_challenge_1_sample12_ohtcfrp/oht_cfrp_*.tiff"
    words = ["--roi", "auto", "--no-view", "--no-rrd", "--zoi", "64", "--step", "64"]
    assert main(["replay", shots, *words, "--out", str(tmp_path / "once")]) == 0
    words = ["--static", "none", "--loaded", "2,3", "--zoi", "32,40,48,64", "--roi", "all"]
    words += ["--mask", str(tmp_path / "once" / "mask.png"), "--out", str(tmp_path / "study")]
    assert main(["study", shots, *words]) == 0
    assert "take 40 px ZOIs, step 10, order 1" in capsys.readouterr().out
    seen = {int(row["zoi"]): row["seen"] for row in rows(tmp_path / "study")}
    assert seen[64] < 0.9 * seen[40]
    assert seen[32] == pytest.approx(seen[40], rel=0.05)


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--zoi", "a"], "give whole numbers"),
        (["--zoi", "0"], "give numbers from 1"),
        (["--window", "round"], "there are gaussian"),
        (["--static", "3,1"], "the first must be the smaller"),
        (["--static", "3"], "give two numbers"),
    ],
)
def test_what_is_refused(
    session: Path, capsys: pytest.CaptureFixture[str], words: list[str], says: str
) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["study", str(session), *words])
    assert ended.value.code == 2
    assert says in capsys.readouterr().err


def found(zoi: int, noise: float, seen: float) -> StudyResult:
    setting = StudySetting(zoi, zoi // 4, 1, "gaussian")
    return StudyResult(setting, noise, noise, 2.0 * zoi, 0.7 * zoi, seen, noise, 0.0, 1.0)


def test_the_knee() -> None:
    tried = [found(16, 4e-3, 9e-3), found(32, 2e-4, 5.0e-3), found(48, 1e-4, 4.9e-3), found(96, 3e-5, 4e-3)]
    advice = recommended(tried)  # what 16 px show is noise
    assert advice.found.setting.zoi == 48
    assert "at least 95%" in advice.why
    assert "96 px ZOIs, step 24, order 1, gaussian has less, but shows 80%" in advice.why
    assert "smallest tried" in recommended(tried[1:2] + tried[3:]).why
    with pytest.raises(ConfigError, match="above its noise"):
        recommended(tried[:1])


def test_a_strain_counts_from_three_sigmas_on() -> None:
    assert not found(32, 1e-3, 2.9e-3).is_significant
    assert found(32, 1e-3, 3.1e-3).is_significant


def test_the_largest_strain_and_its_uncertainty_are_those_of_the_other_half_of_the_bursts() -> None:
    """Its place is found in one half of them, its value read in the other: a mean of three less one of two."""
    grid, rng = ZoiGrid.cover(Roi(0, 0, 160, 128), 32, 16), np.random.default_rng(4)
    peak = np.where((grid.x == grid.x[3]) & (grid.y == grid.y[2])[:, None], 5e-3, 1e-3)

    def fields(count: int, strain: np.ndarray) -> list[StrainField]:
        noise = rng.normal(0, 1e-4, (count, *grid.shape))
        return [StrainField.from_values(grid, {"dv_dy": strain + one}, 1e-4) for one in noise]

    result = _found(StudySetting(32, 16, 1, "gaussian"), "y", fields(4, 0 * peak), fields(6, peak))
    assert result.noise == pytest.approx(1e-4, rel=0.15) and result.predicted == pytest.approx(1e-4)
    assert result.sigma == pytest.approx(result.noise * math.sqrt(1 / 3 + 1 / 2))
    assert result.seen == pytest.approx(5e-3, abs=4 * result.sigma)
    assert result.gradient == pytest.approx(4e-3 / 16, rel=0.1)


def test_the_share_of_zois_with_a_value_is_that_of_the_active_ones() -> None:
    active = np.ones((7, 9), bool)
    active[0], active[1, :3] = False, False
    grid = ZoiGrid.cover(Roi(0, 0, 160, 128), 32, 16).subset(active=active)
    status = np.where(active, 0, 1)
    status[3, 2:8] = 5  # in one picture alone

    def field(status: np.ndarray) -> StrainField:
        return StrainField.from_values(grid, {"dv_dy": 1e-3}, 1e-4, status=status)

    loaded = [field(np.where(active, 0, 1)), field(status)]
    result = _found(StudySetting(32, 16, 1, "gaussian"), "y", [field(np.where(active, 0, 1))] * 2, loaded)
    assert result.valid == (51 - 6) / 51
