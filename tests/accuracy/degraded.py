"""Pictures that are not raw, or not like their reference: kept, error, coverage, and what is wrong.

A real picture (the planar tension set) is moved by 2.3 px and strained by 1e-3 as a trigonometric polynomial, which
shares nothing with the splines of the kernel. Both pictures, or the later one, then suffer what cameras, codecs and
light do to them. Needs PHASEDIC_DATA.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from acquire.burst import BurstAccumulator
from acquire.camera.contract import open_camera
from acquire.frame import Burst
from analysis import PhaseKernel, Roi, StrainField, ZoiGrid
from live.pipeline.measure import Tracker
from live.pipeline.reference import frame_noise
from tests.accuracy.truth import Speckle, affine

Array = NDArray[np.float64]
Image = NDArray[np.uint8]
Rng = np.random.Generator
SET, FILE = "planar_tension", "img_0.tif"
SHIFT_PX, STRAIN = 2.3, 1e-3
BAND = 0.4
"""Cycles per pixel beyond which nothing of the real picture is kept: it could not be moved."""
SIZE, STEP, RIM = 32, 16, 12
WRONG_PX = 0.5
MIN_KEPT, MAX_WRONG, WITHIN = 0.97, 1e-3, (0.60, 0.75)
OTHER_WITHIN = {"gamma 0.7 later": (0.60, 0.88)}
"""What a change of gamma leaves goes with the pattern and moves u less than noise does: u has too large a sigma."""
QUICK = ("noise 1 GL", "JPEG 50", "banding 10 GL that moves", "salt and pepper 1 %", "wire that stands still")
RATIOS = [pair for a in (0, 1) for b in (2, 3, 5) for pair in ((a, b), (b, a))]
MIN_KEPT_NOISE, RATIO_WITHIN = 0.99, 0.05


def _moved(picture: Array, shift: float, strain: float) -> Array:
    """The picture at x -> x + shift + strain (x - middle), both axes: cosine series, band limited."""
    for axis in (0, 1):
        n = picture.shape[axis]
        x = np.arange(n) - (n - 1) / 2
        waves = np.arange(int(2 * BAND * n))
        here = (x - shift) / (1 + strain) + n / 2
        basis = np.cos(np.pi * np.outer(here, waves) / n)
        of = np.cos(np.pi * np.outer(x + n / 2, waves) / n) * np.where(waves == 0, 1, 2) / n
        picture = np.moveaxis(np.tensordot(basis @ of.T, picture, (1, axis)), 0, axis)
    return picture


@lru_cache(maxsize=4)
def pair(folder: Path) -> tuple[Array, Array]:
    """The undegraded pictures, GL."""
    image = cv2.imread(str(folder / SET / FILE), cv2.IMREAD_GRAYSCALE)
    if image is None:
        raise FileNotFoundError(folder / SET / FILE)
    height, width = image.shape
    part = image[height // 2 - 200 : height // 2 + 200, width // 2 - 280 : width // 2 + 280].astype(float)
    return _moved(part, 0, 0), _moved(part, SHIFT_PX, STRAIN)


def stored(picture: Array) -> Image:
    return np.clip(np.rint(picture), 0, 255).astype(np.uint8)


def _noisy(picture: Array, rng: Rng, sigma: float = 1.0) -> Array:
    return picture + rng.normal(0, sigma, picture.shape)


def _jpeg(picture: Array, quality: int) -> Image:
    data = cv2.imencode(".jpg", stored(picture), [cv2.IMWRITE_JPEG_QUALITY, quality])[1]
    return np.asarray(cv2.imdecode(data, cv2.IMREAD_GRAYSCALE), np.uint8)


def _codec(picture: Array, rng: Rng) -> Array:
    """A slight blur, blocks of 8 px with levels of their own, coarse steps."""
    soft = cv2.GaussianBlur(picture, (0, 0), 0.7)
    blocks = rng.normal(0, 1.5, (picture.shape[0] // 8 + 1, picture.shape[1] // 8 + 1))
    soft += np.kron(blocks, np.ones((8, 8)))[: picture.shape[0], : picture.shape[1]]
    return _jpeg(soft, 60).astype(float)


def _spots(picture: Array, rng: Rng, share: float, levels: tuple[float, ...]) -> Array:
    out = picture.copy()
    where = rng.random(picture.shape) < share
    out[where] = rng.choice(levels, where.sum())
    return out


def _wire(picture: Array) -> Array:
    y, x = np.indices(picture.shape)
    away = np.abs((x - 60) * 0.55 - (y - 20) * 0.835)
    return np.where(away < 4, 30 + 3 * away**2, picture)


def _column(n: int, values: Array) -> Array:
    return np.broadcast_to(values[:, None], (len(values), n))


def _banding(picture: Array, phase: float) -> Array:
    rows = np.arange(picture.shape[0])
    return picture + _column(picture.shape[1], 10 * np.sin(2 * np.pi * rows / 23 + phase))


def _ramp(picture: Array) -> Array:
    return picture * np.linspace(0.75, 1.1, picture.shape[1])


Degraded = Callable[[Array, Rng, bool], Array]
"""Of a picture with little noise; the last argument: whether it is the later one."""
CASES: dict[str, Degraded] = {
    "noise 1 GL": lambda p, r, later: p,
    "noise 5 GL": lambda p, r, later: _noisy(p, r, 5),
    "noise 12 GL": lambda p, r, later: _noisy(p, r, 12),
    "JPEG 80": lambda p, r, later: _jpeg(p, 80),
    "JPEG 50": lambda p, r, later: _jpeg(p, 50),
    "video codec": lambda p, r, later: _codec(p, r),
    "banding 10 GL that moves": lambda p, r, later: _banding(p, 2.0 if later else 0.3),
    "noise of lines 3 GL": lambda p, r, later: p + _column(p.shape[1], r.normal(0, 3, p.shape[0])),
    "blur of 1 px later": lambda p, r, later: _noisy(cv2.GaussianBlur(p, (0, 0), 1), r, 0.5) if later else p,
    "bilateral denoising": lambda p, r, later: cv2.bilateralFilter(_noisy(p, r, 2).astype(np.float32), 5, 25, 2),
    "median denoising": lambda p, r, later: cv2.medianBlur(_noisy(p, r, 2).astype(np.float32), 3),
    "hot pixels 0.2 %": lambda p, r, later: _spots(p, np.random.default_rng(7), 0.002, (255.0,)),
    "salt and pepper 1 %": lambda p, r, later: _spots(p, r, 0.01, (0.0, 255.0)),
    "gamma 0.7 later": lambda p, r, later: 255 * np.clip(p / 255, 0, 1) ** 0.7 if later else p,
    "light gradient later": lambda p, r, later: _ramp(p) if later else p,
    "flicker later": lambda p, r, later: 0.8 * p if later else p,
    "sharpening": lambda p, r, later: 2 * p - cv2.GaussianBlur(p, (0, 0), 1),
    "4 bit": lambda p, r, later: 17 * np.rint(np.clip(p, 0, 255) / 17),
    "contrast 15 %": lambda p, r, later: 0.15 * (p - 100) + 100,
    "wire that stands still": lambda p, r, later: _wire(p),
}  # fmt: skip


def pictures(folder: Path, name: str, seed: int = 1) -> tuple[Image, Image]:
    """Reference and later picture of a case."""
    rng = np.random.default_rng(seed)
    first, second = (stored(CASES[name](_noisy(p, rng), rng, k == 1)) for k, p in enumerate(pair(folder)))
    return first, second


@dataclass(frozen=True)
class Outcome:
    """Shares of the ZOIs that should have a value: kept, within one sigma of u, v and of the gradients, wrong."""

    kept: float
    error_px: float
    within: float
    within_strain: float
    wrong: int
    zois: int
    exx: tuple[float, float]


def grid_of(shape: tuple[int, int], step: int = STEP) -> ZoiGrid:
    return ZoiGrid.cover(Roi(RIM, RIM, shape[1] - 2 * RIM, shape[0] - 2 * RIM), SIZE, step)


def errors(field: StrainField, shape: tuple[int, int]) -> dict[str, Array]:
    """Value less truth by name."""
    grid = field.grid
    x, y = np.meshgrid(grid.x - (shape[1] - 1) / 2, grid.y - (shape[0] - 1) / 2)
    return {
        "u": field.u - SHIFT_PX - STRAIN * x, "v": field.v - SHIFT_PX - STRAIN * y,
        "exx": field.exx - STRAIN, "eyy": field.eyy - STRAIN, "du_dy": field.du_dy, "dv_dx": field.dv_dx,
    }  # fmt: skip


def outcome(field: StrainField, shape: tuple[int, int], covered: NDArray[np.bool_] | None = None) -> Outcome:
    """``covered`` (R, C): ZOIs that cannot be right."""
    should = np.ones(field.grid.shape, bool) if covered is None else ~covered
    off = errors(field, shape)
    ok = field.ok & should
    within = {n: np.abs(off[n][ok]) < field.sigma(n)[ok] for n in off}
    both = np.hypot(off["u"], off["v"])
    mean, sigma = field.mean("exx", ok)
    return Outcome(
        float(ok.sum() / should.sum()), float(np.median(np.abs(off["u"][ok]))) if ok.any() else np.nan,
        float(np.mean([within["u"], within["v"]])),
        float(np.mean([within[n] for n in ("exx", "eyy", "du_dy", "dv_dx")])),
        int(np.sum(both[field.ok] > WRONG_PX)), int(should.sum()), (mean - STRAIN, sigma),
    )  # fmt: skip


def under_wire(grid: ZoiGrid) -> NDArray[np.bool_]:
    """ZOIs that the wire touches where their weight is more than a hundredth."""
    x, y = np.meshgrid(grid.x, grid.y)
    return np.asarray(np.abs((x - 60) * 0.55 - (y - 20) * 0.835) < 4 + 0.45 * SIZE)


def measured(folder: Path, name: str, noise: float | None = None) -> Outcome:
    """One case as a folder of two pictures is measured; ``noise``: as stated, GL."""
    first, second = pictures(folder, name)
    grid = grid_of(first.shape)
    field = PhaseKernel(first, grid, noise=noise).measure(second, noise=noise)
    return outcome(field, first.shape, under_wire(grid) if name.startswith("wire") else None)


def cases(folder: Path, quick: bool) -> Iterator[tuple[str, tuple[Outcome, bool]]]:
    """What was found of each case, and whether it keeps to the limits."""
    for name in QUICK if quick else CASES:
        found = measured(folder, name)
        low, high = OTHER_WITHIN.get(name, WITHIN)
        good = (
            found.kept >= MIN_KEPT and low <= found.within <= high and found.wrong <= MAX_WRONG * found.zois
        )
        yield name, (found, good)


def ratio_cases(folder: Path, quick: bool) -> Iterator[tuple[tuple[str, ...], float, float, bool]]:
    """Noise of the reference, of the picture and as stated, GL; kept, predicted over observed, within the limits."""
    for first, second in RATIOS[:2] if quick else RATIOS:
        # A reference that is said to be sharper than its noise lets it pass for pattern: sigma 10 % too small at 5 GL.
        for stated in (None, *sorted({float(max(noise, 0.3)) for noise in (first, max(first, second))})):
            kept, ratio, error = ratio_of_noise(folder, first, second, stated)
            good = kept >= MIN_KEPT_NOISE and abs(ratio - 1) <= RATIO_WITHIN + 2 * error
            yield (f"{first}", f"{second}", "none" if stated is None else f"{stated:g}"), kept, ratio, good


def ratio_of_noise(
    folder: Path, first: float, second: float, stated: float | None
) -> tuple[float, float, float]:
    """Share kept, predicted over observed scatter of u, v and gradients, for noises of two levels, GL; its error."""
    rng = np.random.default_rng(3)
    images = [stored(_noisy(p, rng, s)) for p, s in zip(pair(folder), (first, second), strict=True)]
    grid = grid_of(images[0].shape)
    field = PhaseKernel(images[0], grid, noise=stated).measure(images[1], noise=stated)
    off, ok = errors(field, images[0].shape), field.ok
    ratios = [np.sqrt(np.mean(field.sigma(n)[ok] ** 2) / np.mean(off[n][ok] ** 2)) for n in off]
    # Six values that ZOIs half a width apart show independently, as their windows hardly overlap.
    return float(ok.mean()), float(np.mean(ratios)), float(1 / np.sqrt(2 * len(ratios) * ok.sum()))


FILM_SHAPE, FILM_PICTURES, FILM_STRAIN = (480, 640), 60, 7.8e-3
FILMS = {"MJPG avi": ("MJPG", ".avi"), "mp4": ("mp4v", ".mp4")}


def film(kind: str, folder: Path) -> Path:
    """A simulated tension test as OpenCV writes it."""
    code, ending = FILMS[kind]
    path = folder / f"film{ending}"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*code), 10.0, FILM_SHAPE[::-1], False)
    rng = np.random.default_rng(5)
    for k in range(FILM_PICTURES):
        e = FILM_STRAIN * k / (FILM_PICTURES - 1)
        level = Speckle(2.0, 1).at(*affine(FILM_SHAPE, dv_dy=e, du_dx=-0.3 * e))
        writer.write(stored(_noisy(255 * level, rng, 1.5)))
    writer.release()
    return path


def film_measured(kind: str) -> tuple[float, float, float, int]:
    """Share kept in the last picture, mean eyy less truth and its sigma, and renewals of the reference."""
    events: list[object] = []
    with tempfile.TemporaryDirectory() as folder:
        bursts = list(_bursts(f"video:{film(kind, Path(folder))}?gray=luma"))
    grid = grid_of(FILM_SHAPE)
    noise = frame_noise(bursts[0], None)
    tracker = Tracker(PhaseKernel(bursts[0].mean, grid, noise=noise), noise, 0.1, events.append)
    for burst in bursts[1:]:
        field = tracker.measure(burst)
    mean, sigma = field.mean("eyy")
    return float(field.ok.mean()), mean - FILM_STRAIN, sigma, len(events)


def _bursts(address: str) -> Iterator[Burst]:
    for frame in open_camera(address):
        burst = BurstAccumulator(1).add(frame)
        assert burst is not None
        yield burst
