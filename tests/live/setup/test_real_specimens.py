"""The specimen found in real pictures; run where PHASEDIC_DATA names the image sets.

The edges of the polymer bar were read from the enlarged picture by eye, to 3 px; those of the open-hole
specimen are where its light paint ends, since all around it is black.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest

from analysis.quality.specimen import find_specimen
from live.config.loading import load_config
from live.pipeline.consumer import Screen
from live.setup.region import Region, first_look, region_of

pytestmark = pytest.mark.data

BAR = {
    100: (294, 572),
    300: (312, 548),
    600: (309, 546),
    1000: (306, 542),
    1400: (303, 538),
    1700: (300, 537),
}
"""Row -> left and right edge, px."""
ZOI = 32
HALF = ZOI / 2


def region_in(path: Path) -> Region:
    config = load_config(None, {"camera.address": f"files:{path}", "measure.zoi": ZOI})
    first = first_look(config, Screen())
    return region_of(config, first.picture, first.noise)


def test_the_polymer_bar(data_dir: Path) -> None:
    mask = region_in(data_dir / "mudic_tension" / "ut_151.tif").mask
    for row, (left, right) in BAR.items():
        inside = np.flatnonzero(mask[row])
        assert abs(inside[0] - left) < HALF, row
        assert abs(inside[-1] + 1 - right) < HALF, row
        assert inside.size == inside[-1] + 1 - inside[0]
    assert not mask[:, :60].any()
    assert not mask[200:1600, 700:].any()


def test_the_open_hole(data_dir: Path) -> None:
    path = data_dir / "dic_challenge_1_sample12_ohtcfrp" / "oht_cfrp_00.tiff"
    mask = region_in(path).mask
    assert mask is not None
    picture = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
    bright = (cv2.GaussianBlur(picture, (0, 0), 4) > 30).astype(np.uint8)
    painted = cv2.morphologyEx(bright, cv2.MORPH_CLOSE, np.ones((15, 15), np.uint8)) > 0
    beyond = cv2.distanceTransform((~painted).astype(np.uint8), cv2.DIST_L2, 5)
    within = cv2.distanceTransform(painted.astype(np.uint8), cv2.DIST_L2, 5)
    assert not mask[beyond > HALF].any()
    # The picture's own rim is no edge; speckles of black paint are no holes.
    deep = (within > HALF)[16:-16]
    assert mask[16:-16][deep].mean() > 0.999
    hole = np.hypot(*np.mgrid[-540:500, -191:209]) < 55 - HALF
    assert not mask[hole].any()


def pictures(folder: Path) -> Iterator[Path]:
    yield from sorted(p for p in folder.rglob("*") if p.suffix in (".tif", ".tiff", ".png"))


@pytest.mark.slow
def test_every_real_picture_has_its_specimen(data_dir: Path) -> None:
    """What fills the picture is found all over it, what does not, not."""
    for path in pictures(data_dir):
        picture = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE | cv2.IMREAD_ANYDEPTH)
        found = find_specimen(picture)
        assert found is not None, path
        fills = any(name in path.name for name in ("Star", "Sample14", "Sample5"))
        assert (found.share > 0.9) == fills, (path, found.share)
