"""Makes the README's pictures of real images: ``python -m docs.make_pictures`` with PHASEDIC_DATA set.

Open-hole tension of a carbon-fibre composite: DIC Challenge 1.0, sample 12 (SEM/iDICs), from DICe's regression
tests. Tension of a polymer bar: the examples of muDIC (MIT).
"""

from __future__ import annotations

import os
import sys
import tempfile
from pathlib import Path

from live.cli import main
from tests.live.test_real_images import specimen_mask

IMAGES = Path(__file__).parent / "images"


def replay(source: str, out: Path, *more: str) -> Path:
    """Replay pictures; the path of the results."""
    if main(["replay", source, "--out", str(out), "--no-view", "--no-rrd", *more]) != 0:
        sys.exit(f"the replay of {source} failed")
    return out / "strain.h5"


def draw(results: Path, name: str, over: Path, field: str, title: str, *more: str) -> None:
    """Draw one map anew."""
    png = IMAGES / name
    png.unlink(missing_ok=True)
    main(["map", str(results), str(png), "--field", field, "--over", str(over), "--title", title, *more])


def make(data: Path, work: Path) -> None:
    """All pictures."""
    hole = data / "dic_challenge_1_sample12_ohtcfrp"
    first = hole / "oht_cfrp_00.tiff"
    mask = specimen_mask(first, 30, work / "mask.png")
    found = replay(f"files:{hole}/*.tiff", work / "hole", "--mask", str(mask), "--zoi", "32", "--step", "5")
    title = "eyy of the open hole, last frame, ZOI 32 px"
    draw(found, "open_hole_eyy.png", first, "eyy", title, "--limit", "0.015")
    draw(found, "open_hole_status.png", first, "status", "status of each ZOI")
    bar = data / "mudic_tension"
    first = bar / "ut_151.tif"
    found = replay(
        f"files:{bar}/*.tif", work / "bar", "--roi", "325,120,200,1620", "--zoi", "48", "--step", "8"
    )
    draw(found, "bar_eyy.png", first, "eyy", "eyy of the polymer bar, necking, ZOI 48 px", "--limit", "0.5")
    draw(found, "bar_status.png", first, "status", "status of each ZOI")


if __name__ == "__main__":
    if not os.environ.get("PHASEDIC_DATA"):
        sys.exit("PHASEDIC_DATA must name the folder of image sets")
    with tempfile.TemporaryDirectory() as folder:
        make(Path(os.environ["PHASEDIC_DATA"]), Path(folder))
