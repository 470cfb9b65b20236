"""Makes the pictures of docs/guide.md and of the report: ``python -m docs.make_rig_pictures``.

The simulator renders the patterns; the text below each is the strain noise of one ZOI that the kernel predicts.
The report is that of the demo, in a browser.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from analysis import KernelSettings, PhaseKernel, Roi, ZoiGrid
from hw_mocks.deformation import Affine
from hw_mocks.speckle import Speckle
from live.cli import main
from live.results.report.saving import NO_BROWSER, find_browser

IMAGES = Path(__file__).parent / "images"
SIDE, SHOWN, ZOI, NOISE_GL = 320, 160, 64, 1.3
Image = NDArray[np.float64]


def pattern(radius: float, low: float = 30, high: float = 215, blur: float = 0.0) -> Image:
    """A picture of speckle, GL of 8 bits, saturated where it is too bright."""
    image = Speckle((SIDE, SIDE), radius=radius, seed=4).render(Affine(), (SIDE, SIDE))
    image = cv2.GaussianBlur(image, (0, 0), blur) if blur else image
    noisy = low + (high - low) * image + np.random.default_rng(0).normal(0, NOISE_GL, image.shape)
    return np.clip(np.rint(noisy), 0, 255)


PATTERNS = {
    "good: speckle of 4 to 5 px": pattern(2.0),
    "out of focus": pattern(2.0, blur=3.0),
    "too little light": pattern(2.0, 10, 50),
    "too much light": pattern(2.0, 60, 420),
    "too fine: aliased, so quiet but wrong": pattern(0.6),
    "too coarse: 20 px": pattern(10.0),
}


def strain_noise(image: Image) -> float:
    """Predicted standard uncertainty of eyy of one ZOI, um/m; NaN where it has no pattern."""
    grid = ZoiGrid.cover(Roi(16, 16, SIDE - 32, SIDE - 32), size=ZOI, step=32)
    try:
        kernel = PhaseKernel(image.astype(np.float32), grid, KernelSettings(), noise=NOISE_GL)
    except ValueError:
        return float("nan")
    clipped = image >= 255
    field = kernel.measure(image.astype(np.float32), noise=NOISE_GL, clipped=clipped)
    return float(1e6 * np.nanmedian(field.sigma_eyy)) if field.n_valid else float("nan")


def panel(image: Image, words: str) -> NDArray[np.uint8]:
    """A part of the picture, twice as large, with words below it."""
    part = image[:SHOWN, :SHOWN].astype(np.uint8)
    large = cv2.resize(part, None, fx=2, fy=2, interpolation=cv2.INTER_NEAREST)
    noise = strain_noise(image)
    result = f"one ZOI: {noise:.0f} um/m" if np.isfinite(noise) else "no ZOI can be measured"
    foot = np.full((52, large.shape[1]), 255, np.uint8)
    for line, (text, level) in enumerate(((words, 0), (result, 90))):
        origin = (4, 18 + 22 * line)
        cv2.putText(foot, text, origin, cv2.FONT_HERSHEY_SIMPLEX, 0.52, level, 1, cv2.LINE_AA)
    framed = np.vstack([large, foot])
    return np.asarray(cv2.copyMakeBorder(framed, 4, 4, 4, 4, cv2.BORDER_CONSTANT, value=255), np.uint8)


def patterns() -> None:
    """The sheet of patterns."""
    panels = [panel(image, words) for words, image in PATTERNS.items()]
    sheet = np.vstack([np.hstack(panels[:3]), np.hstack(panels[3:])])
    cv2.imwrite(str(IMAGES / "patterns.png"), sheet, [cv2.IMWRITE_PNG_COMPRESSION, 9])


def report(work: Path) -> None:
    """The first screen of the report of a demo."""
    main(["demo", "--no-view", "--report", "--out", str(work / "demo")])
    browser = find_browser()
    if browser is None:
        sys.exit(f"the picture of the report: {NO_BROWSER}")
    window = ["--headless", "--no-sandbox", "--hide-scrollbars", "--window-size=1280,1180"]
    shot = f"--screenshot={work / 'report.png'}"
    page = (work / "demo" / "report.html").absolute().as_uri()
    subprocess.run([browser, *window, shot, page], check=True, capture_output=True)
    image = cv2.imread(str(work / "report.png"))
    small = cv2.resize(image, (960, 885), interpolation=cv2.INTER_AREA)
    cv2.imwrite(str(IMAGES / "report.png"), small, [cv2.IMWRITE_PNG_COMPRESSION, 9])


if __name__ == "__main__":
    patterns()
    if sys.argv[1:] != ["--patterns"]:
        with tempfile.TemporaryDirectory() as folder:
            report(Path(folder))
