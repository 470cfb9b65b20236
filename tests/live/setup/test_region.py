"""The region of a test (found, stored, the same in a replay), and automatic gauges beside holes and at any strain."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import h5py
import numpy as np
import pytest

from acquire.errors import ConfigError, DeviceError
from analysis import Roi, ZoiGrid
from analysis.evaluate import REGION, GaugeSet
from analysis.quality.specimen import Specimen
from live.cli import main
from live.config.gauges import gauges_for
from live.config.loading import Config, load_config
from live.pipeline.consumer import Screen
from live.results import Strain
from live.setup.check.sample import take
from live.setup.devices import open_rig
from live.setup.grid import auto_gauges, with_auto_gauges
from live.setup.region import FirstLook, Region, _mean_and_noise, _within, first_look, located_on, region_of
from live.setup.rig_proposal import _axis, _size
from tests.live.made_up import CAMERA, make_field
from tests.live.screens import RecordingScreen

SIM = "sim:hole?seconds=2&fps=20&width=320&height=320&hole=40&lockstep=yes"
QUICK = ["--zoi", "32", "--step", "16", "--no-view", "--no-rrd"]


def config_of(folder: Path) -> dict:
    found: dict = json.loads((folder / "config.json").read_text())
    return found


def test_a_run_without_a_region_finds_the_specimen(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    live, again = tmp_path / "live", tmp_path / "again"
    reference = ["--reference-burst", "4", "--burst", "2"]
    assert main(["run", "--camera", SIM, "--gauges", "auto", *reference, "--out", str(live), *QUICK]) == 0
    assert "the specimen was found" in capsys.readouterr().out
    stored = config_of(live)["measure"]
    assert stored["mask"] == str(live / "mask.png")
    assert stored["gauges"] == "given"
    mask = cv2.imread(stored["mask"], cv2.IMREAD_GRAYSCALE)
    assert not mask[160, 160]
    assert mask[100, 40]
    assert main(["replay", str(live / "session.h5"), "--as-measured", "--out", str(again), *QUICK[-2:]]) == 0
    with Strain.open(live / "strain.h5") as one, Strain.open(again / "strain.h5") as two:
        assert not one.grid.active.all()
        np.testing.assert_array_equal(one.maps("eyy", -1), two.maps("eyy", -1))
    # A replay may look for itself: in the reference, with gauges that are placed anew.
    third = tmp_path / "third"
    arguments = ["--roi", "auto", "--gauges", "auto", "--zoi", "48", "--out", str(third), *QUICK[-2:]]
    assert main(["replay", str(live / "session.h5"), *arguments]) == 0
    assert "the specimen was found" in capsys.readouterr().out
    with h5py.File(third / "strain.h5") as file:
        assert set(file["entry/gauges"]) >= {"extension", "width", "area"}


def pictures(folder: Path) -> str:
    """Speckle on a disc, on grey; the disc moves by two pixels."""
    rng = np.random.default_rng(3)
    y, x = np.mgrid[:300, :340]
    pattern = cv2.GaussianBlur(rng.normal(size=x.shape).astype(np.float32), (0, 0), 1.6)
    disc = np.hypot(x - 170, y - 150) < 110
    one = np.where(disc, 120 + 250 * pattern, 120) + rng.normal(0, 1, x.shape)
    for k in range(2):
        moved = np.roll(one, 2 * k, axis=1) + rng.normal(0, 0.5, x.shape)
        cv2.imwrite(str(folder / f"p{k}.png"), np.clip(moved, 0, 255).astype(np.uint8))
    return f"files:{folder}/p*.png"


def test_pictures_are_replayed_on_the_specimen_alone(tmp_path: Path) -> None:
    source = pictures(tmp_path)
    assert main(["replay", source, "--out", str(tmp_path / "found"), *QUICK]) == 0
    with Strain.open(tmp_path / "found" / "strain.h5") as strain:
        x, y = np.meshgrid(strain.grid.x, strain.grid.y)
        far = np.hypot(x - 169.5, y - 149.5)
        assert not strain.grid.active[far > 110].any()
        assert strain.grid.active[far < 75].all()
        np.testing.assert_allclose(strain.maps("u", -1)[strain.grid.active], 2, atol=0.05)
    assert (tmp_path / "found" / "mask.png").exists()
    assert main(["replay", source, "--roi", "all", "--out", str(tmp_path / "all"), *QUICK]) == 0
    with Strain.open(tmp_path / "all" / "strain.h5") as strain:
        assert strain.grid.active.all()


def test_a_picture_without_specimen() -> None:
    """Noise alone is no specimen: the picture except a rim is measured, with a message."""
    from acquire.frame import CameraInfo

    picture = np.random.default_rng(0).normal(100, 2, (200, 200)).astype(np.float32)
    camera = CameraInfo("none", "none", 200, 200, 8, False, "nominal")
    screen = RecordingScreen()
    config, mask = located_on(load_config(None, {"measure.zoi": 32}), FirstLook(picture, 2.0, camera), screen)
    assert mask is None
    assert config.measure.roi == "all"
    assert screen.lines[0].startswith("no specimen was found that stands out")


def test_warnings_of_the_camera_are_printed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its warning is printed, its information is not."""
    from acquire.events import Event, EventKind

    def troubled(address: str, load: str, on_event, **how):
        on_event(Event(0.0, EventKind.LOST, "camera", "no picture for 2.0 s; still waiting", "warning"))
        on_event(Event(0.0, EventKind.LOST, "camera", "opened", "info"))
        return open_rig(address, load, on_event, **how)

    monkeypatch.setattr("live.setup.pictures.open_rig", troubled)
    screen = RecordingScreen()
    first = first_look(load_config(None, {"camera.address": SIM}), screen)
    assert screen.lines == ["no picture for 2.0 s; still waiting"]
    assert first.size == (320, 320)


@pytest.mark.parametrize("fault", ["disconnect@0*600", "damage@0*600"])
@pytest.mark.parametrize("look", [lambda config: first_look(config, Screen()), take])
def test_a_camera_without_whole_pictures_is_given_up(
    monkeypatch: pytest.MonkeyPatch, look: Callable[[Config], object], fault: str
) -> None:
    """A run waits for it; a look before a test, which nobody's test hangs on, ends and names what to look at."""
    monkeypatch.setattr("live.setup.pictures.SILENCE_S", 0.3)
    silent = f"sim:hole?fps=20&width=320&height=320&hole=40&faults={fault}"
    with pytest.raises(DeviceError, match=r"no whole picture came in 0\.3 s; look at its cable"):
        look(load_config(None, {"camera.address": silent}))


@pytest.mark.parametrize(
    "address",
    [
        "sim:hole?width=400&height=360&hole=50&lockstep=yes&seconds=2",
        "sim:hole?width=400&height=360&hole=30&radius=3.5&noise=3&bits=8&lockstep=yes&seconds=2",
        "sim:woven?width=300&height=260&lockstep=yes&seconds=2",
    ],
)
def test_simulated_specimens(address: str) -> None:
    """The mask is that of the simulated specimen, to half a ZOI."""
    config = load_config(None, {"camera.address": address, "measure.zoi": 32})
    rig = open_rig(address, "none:")
    rig.close()
    truth = rig.specimen.mask()
    first = first_look(config, Screen())
    inside = region_of(config, first.picture, first.noise).inside(*first.size, 32)
    distance = [cv2.distanceTransform(part.astype(np.uint8), cv2.DIST_L2, 5) for part in (truth, ~truth)]
    assert not inside[distance[1] > 16].any()
    deep = distance[0] > 16 if not truth.all() else truth
    assert inside[4:-4, 4:-4][deep[4:-4, 4:-4]].all()


BOX = Roi(100, 40, 120, 500)


def strip(*holes: tuple[int, int, int], slope: float = 0.0) -> np.ndarray:
    """A strip 120 px wide and 500 px high, with round holes (x, y, radius) or leaning by ``slope``."""
    y, x = np.mgrid[:600, :400]
    mask = (x >= 100 + slope * y) & (x < 220 + slope * y) & (y >= 40) & (y < 540)
    for x0, y0, radius in holes:
        mask &= np.hypot(x - x0, y - y0) > radius
    return np.asarray(mask)


def grid_on(mask: np.ndarray, size: int = 32, step: int = 8) -> ZoiGrid:
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    x, y = int(columns[0]), int(rows[0])
    return ZoiGrid.cover(Roi(x, y, int(columns[-1]) + 1 - x, int(rows[-1]) + 1 - y), size, step, mask)


def test_extension_and_area_have_all_zois_of_the_specimen() -> None:
    grid = grid_on(strip())
    gauges = auto_gauges(grid, "y")
    assert list(gauges) == ["extension", "width", "area"]
    assert gauges["extension"]["box"] == gauges["area"]["box"]
    ends, (everywhere,) = (
        gauges_for({name: gauges[name]}, "y", grid)[0].zois(grid) for name in ("extension", "area")
    )
    assert everywhere.sum() == grid.n_active
    rows, columns = grid.shape
    for mask, first in zip(ends, (0, rows - round(rows / 6)), strict=True):
        assert mask.any(axis=0).sum() == columns, "as wide as the specimen"
        assert np.flatnonzero(mask.any(axis=1))[0] == pytest.approx(first, abs=1)
        assert mask.any(axis=1).sum() == pytest.approx(rows / 6, abs=1)


def test_the_automatic_extension_is_that_of_the_region() -> None:
    grid = grid_on(strip((160, 290, 40)))
    field, (gauge,) = (
        make_field(grid, 1e-3),
        gauges_for({"e": auto_gauges(grid, "y")["extension"]}, "y", grid),
    )
    assert gauge.measure(field) == GaugeSet(REGION).read(field)["extension_y"]


@pytest.mark.parametrize("axis", ["x", "y"])
@pytest.mark.parametrize(
    ("mask", "slope"),
    [(strip(), 0), (strip((160, 290, 40)), 0), (strip((160, 90, 30)), 0), (strip(slope=0.3), 0.3)],
    ids=["plain", "hole", "hole at an end", "leaning"],
)
def test_all_are_on_zois_and_read_the_strain(mask: np.ndarray, slope: float, axis: str) -> None:
    mask = mask if axis == "y" else mask.T
    grid = grid_on(mask)
    config = load_config(None, {"measure.gauges": "auto", "specimen.axis": axis})
    config = with_auto_gauges(config, grid)
    assert config.measure.gauges == "given"
    field = make_field(grid, 1e-3)
    across = "exx" if axis == "y" else "eyy"
    along = "eyy" if axis == "y" else "exx"
    values = {g.name: g.measure(field) for g in gauges_for(config.gauges, config.specimen.first_axis, grid)}
    assert list(values) == ["extension", "width", "area"]
    assert values["area"].value == pytest.approx(field.mean(along)[0], abs=1e-9)
    # The line between the ends of a leaning strip stands aslant.
    assert values["width"].value == pytest.approx(field.mean(across)[0], rel=0.03)
    aslant = (field.mean(along)[0] + slope**2 * field.mean(across)[0]) / (1 + slope**2)
    assert values["extension"].value == pytest.approx(aslant, rel=0.03)


def test_what_is_given_stays(tmp_path: Any) -> None:
    own = {"kind": "area", "box": [120, 100, 60, 60]}
    config = load_config(None, {"measure.gauges": "auto", "gauges.extension": own, "gauges.mine": own})
    placed = with_auto_gauges(config, grid_on(strip()))
    assert placed.gauges["extension"]["kind"] == "area"
    assert list(placed.gauges) == ["extension", "width", "area", "mine"]
    assert with_auto_gauges(placed, grid_on(strip())) is placed


def test_a_narrow_specimen_has_no_width() -> None:
    grid = ZoiGrid.cover(Roi(10, 10, 36, 200), 32, 8)
    assert list(auto_gauges(grid, "y")) == ["extension", "area"]


def test_too_short_a_specimen_is_refused() -> None:
    with pytest.raises(ConfigError, match="1 rows of ZOIs lie along the load"):
        auto_gauges(ZoiGrid.cover(Roi(10, 10, 200, 36), 32, 8), "y")


@pytest.mark.parametrize(
    ("width", "zoi"), [(640, 64), (256, 64), (255, 48), (191, 32), (127, 24), (95, 16), (40, 16)]
)
def test_the_largest_zoi_is_proposed_of_which_four_lie_across(width: int, zoi: int) -> None:
    config = load_config(None, {})
    look = FirstLook(np.zeros((480, 640), np.uint8), None, CAMERA)
    for axis, box in (("y", (0, 0, width, 480)), ("x", (0, 0, 640, min(width, 480)))):
        along = replace(config, specimen=replace(config.specimen, axis=axis))
        expected = zoi if axis == "y" or width < 480 else 64
        assert _size(Region(box, None, ""), along, look) == expected


@pytest.mark.parametrize(
    ("size", "axis"), [((640, 480), "y"), ((450, 300), "y"), ((451, 300), "x"), ((200, 480), "y")]
)
def test_a_slender_specimen_is_pulled_along_its_length(size: tuple[int, int], axis: str) -> None:
    assert _axis(Region((0, 0, *size), None, ""), True) == axis
    assert _axis(Region((0, 0, *size), None, ""), False) == "y"


@pytest.mark.parametrize(
    ("rows", "hole", "fills"), [(200, 0, True), (200, 9, False), (195, 0, False), (100, 0, False)]
)
def test_a_specimen_that_fills_the_picture_has_no_mask(
    monkeypatch: pytest.MonkeyPatch, rows: int, hole: int, fills: bool
) -> None:
    """From 98 % of it on, unless it has a hole of half a ZOI."""
    mask = np.zeros((200, 300), bool)
    mask[:rows] = True
    y, x = np.mgrid[:200, :300]
    mask[np.hypot(y - 100, x - 150) <= hole] = hole == 0
    found = Specimen(mask, Roi(0, 0, 300, rows), 2.0)
    monkeypatch.setattr("analysis.quality.specimen.find_specimen", lambda picture, noise: found)
    region = region_of(load_config(None, {"measure.zoi": 32}), np.zeros((200, 300), np.uint8))
    assert region.found
    assert (region.box is None, region.mask is None) == (fills, fills)
    assert region.words.startswith(
        "the specimen fills" if fills else f"the specimen was found: {mask.mean():.0%}"
    )
    assert region.box in (None, (4, 4, 292, min(192, rows - 4)))


def test_the_mean_of_a_first_look_and_its_noise() -> None:
    images = [np.full((4, 4), value, np.uint8) for value in (10, 12, 11, 15)]
    mean, noise = _mean_and_noise(images)
    assert float(mean[0, 0]) == 12.0 and noise == pytest.approx(float(np.std([2, -1, 4])) / math.sqrt(2) / 2)
    alone, unknown = _mean_and_noise(images[:1])
    assert alone is images[0] and unknown is None
    assert _mean_and_noise([images[0]] * 3)[1] is None


def test_a_found_box_is_cut_by_the_rim() -> None:
    picture, config = np.zeros((200, 300)), load_config(None, {"measure.zoi": 32})
    assert _within(0, 0, 300, 200, config, picture) == (4, 4, 292, 192)
    assert _within(10, 20, 30, 40, config, picture) == (10, 20, 30, 40)
    assert _within(290, 190, 10, 10, config, picture) == (290, 190, 6, 6)
    assert _within(298, 198, 2, 2, config, picture) == (298, 198, 1, 1)
