"""The common error of a picture: noise, verdict and uncertainty from what all fits leave; wild pixels; its cause."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from analysis import KernelSettings, NoiseModel, PhaseKernel, Roi, Status, StrainField, ZoiGrid
from analysis.field import mean_blur
from analysis.fit import pooling
from analysis.fit.kernel_args import CONVERGED, OutArgs, ReferenceArgs
from analysis.fit.pooling import pooled
from analysis.kernel import coloured
from analysis.kernel.coloured import own_error
from analysis.kernel.images import as_image, as_recorded, rounding_variance
from analysis.kernel.lines import left_by_fit
from analysis.kernel.reference import ReferencePicture
from analysis.kernel.solve import Solution
from analysis.kernel.white_noise import white_cubic
from analysis.picture.impulses import without_impulses
from analysis.picture.pattern import BLOCKS, blockiness
from tests.accuracy.truth import Speckle, affine
from tests.accuracy.truth import field as displaced

SHAPE = (320, 320)
GRID = ZoiGrid.cover(Roi(16, 16, 288, 288), 32, 16)
MOTION = {"u": 0.4, "v": -0.3}


def picture(noise: float, seed: int, **motion: float) -> np.ndarray:
    rng = np.random.default_rng(seed)
    level = 128 + 200 * (Speckle(2.0, 3, span=400).at(*affine(SHAPE, **motion)) - 0.5)
    return np.clip(np.rint(level + rng.normal(0, noise, SHAPE)), 0, 255).astype(np.uint8)


def jpeg(image: np.ndarray, quality: int) -> np.ndarray:
    return np.asarray(
        cv2.imdecode(
            cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality])[1], cv2.IMREAD_GRAYSCALE
        )
    )


def predicted_over_observed(field: StrainField, name: str, truth: float) -> float:
    off = field.value(name)[field.ok] - truth
    return float(np.sqrt(np.mean(field.sigma(name)[field.ok] ** 2) / np.mean(off**2)))


@pytest.mark.parametrize("stated", [None, 1.0, 4.0])
@pytest.mark.parametrize(("first", "second"), [(1.0, 4.0), (4.0, 1.0)])
def test_noise_other_than_stated_is_found_and_refuses_nothing(
    first: float, second: float, stated: float | None
) -> None:
    kernel = PhaseKernel(picture(first, 1), GRID, noise=stated)
    field = kernel.measure(picture(second, 2, **MOTION), noise=stated)
    assert field.ok.mean() > 0.99
    for name in ("u", "v"):
        assert predicted_over_observed(field, name, MOTION[name]) == pytest.approx(1, abs=0.15)


def bent(noise: float, seed: int, amplitude: float, correlated_px: float = 0.0) -> np.ndarray:
    """The pattern under v = ``amplitude`` sin(2 pi y / 96), with noise of a strength and of a reach."""
    wave = lambda x, y: (0 * x, amplitude * np.sin(2 * np.pi * y / 96))  # noqa: E731
    added = np.random.default_rng(seed).normal(0, 1, SHAPE)
    if correlated_px:
        added = cv2.GaussianBlur(added, (0, 0), correlated_px)
    level = 128 + 200 * (Speckle(2.0, 3, span=400).at(*displaced(SHAPE, wave)) - 0.5)
    return (level + noise * added / added.std()).astype(np.float32)


@pytest.mark.parametrize("amplitude", [0.018, 0.1])
def test_a_strain_that_bends_within_the_zois_is_no_error_of_the_picture(amplitude: float) -> None:
    """Neither colour where what is left agrees with the noise, nor noise where it is several times as much."""
    zois = ZoiGrid.cover(Roi(16, 16, 288, 288), 64, 8)
    kernel = PhaseKernel(bent(0.25, 1, 0.0), zois, noise=0.25)
    still, strained = (kernel.measure(bent(0.25, 2, by), noise=0.25) for by in (0.0, amplitude))
    assert strained.picture is not None and strained.picture.colour == (1.0, 1.0)
    assert strained.sigma_v == pytest.approx(still.sigma_v, rel=3e-3)  # the strain itself is 1 / 150


def test_waves_in_a_part_of_the_picture_are_no_noise_of_the_rest() -> None:
    """Half of the ZOIs leave several times the noise, since they bend: the others keep their sigma."""
    folded = lambda x, y: (0 * x, np.where(x < 0, 0.6 * np.sin(2 * np.pi * y / 40), 0))  # noqa: E731
    wavy = 128 + 200 * (Speckle(2.0, 3, span=400).at(*displaced(SHAPE, folded)) - 0.5)
    wavy += np.random.default_rng(2).normal(0, 1, SHAPE)
    kernel = PhaseKernel(bent(1.0, 1, 0.0), GRID, KernelSettings(bending_px=np.inf))
    still, found = kernel.measure(bent(1.0, 2, 0.0)), kernel.measure(wavy.astype(np.float32))
    right = np.s_[:, GRID.x > SHAPE[1] / 2 + 20]
    assert np.nanmedian(found.residual[:, GRID.x < 120]) > 1.5
    assert np.mean(found.sigma_v[right]) == pytest.approx(np.mean(still.sigma_v[right]), rel=0.05)


def test_coloured_noise_of_the_strength_given_keeps_its_colour() -> None:
    kernel = PhaseKernel(bent(2.0, 1, 0.0, 1.0), GRID, noise=2.0)
    field = kernel.measure(bent(2.0, 2, 0.0, 1.0), noise=2.0)
    assert field.picture is not None and min(field.picture.colour) > 2
    assert predicted_over_observed(field, "v", 0.0) == pytest.approx(1, abs=0.2)


def test_a_compressed_picture_is_measured_with_the_uncertainty_that_it_has() -> None:
    images = [jpeg(picture(1.5, k, **(MOTION if k else {})), 70) for k in (0, 1)]
    field = PhaseKernel(images[0], GRID).measure(images[1])
    assert field.ok.mean() > 0.97
    within = [np.abs(field.value(n) - MOTION[n])[field.ok] < field.sigma(n)[field.ok] for n in MOTION]
    assert 0.55 < np.mean(within) < 0.8
    assert field.picture is not None and field.picture.cause == "compression"


def test_what_a_part_of_the_picture_leaves_is_not_forgiven() -> None:
    later = picture(1, 2, **MOTION).astype(np.float32)
    soft = cv2.GaussianBlur(later, (0, 0), 2.5)
    later[:, 100:] = soft[:, 100:]
    field = PhaseKernel(picture(1, 1), GRID, noise=1.04).measure(later, noise=1.04)
    assert field.ok[:, GRID.x < 70].all()
    assert not field.ok[:, GRID.x > 130].any()


def test_what_a_blur_leaves_is_pattern_and_counts_no_less_than_white_noise() -> None:
    rng, clean = np.random.default_rng(2), picture(0, 1).astype(np.float32)
    soft = cv2.GaussianBlur(clean, (9, 9), 0.48)
    first, second = (np.rint(image + rng.normal(0, 1, SHAPE)).clip(0, 255) for image in (clean, soft))
    field = PhaseKernel(first.astype(np.uint8), GRID).measure(second.astype(np.uint8))
    blur = mean_blur(field)
    assert 0.3 < blur.px < 0.5 and field.picture is not None
    assert min(field.picture.colour) >= 1


def test_of_an_unrelated_picture_no_common_error_is_taken() -> None:
    other = 128 + 200 * (Speckle(2.0, 77, span=400).at(*affine(SHAPE)) - 0.5)
    field = PhaseKernel(picture(1, 1), GRID).measure(other.astype(np.uint8))
    assert field.n_valid == 0 and field.picture is None


def zois(count: int, left: np.ndarray, signal: np.ndarray) -> tuple[OutArgs, ReferenceArgs]:
    found = OutArgs.starting(np.zeros((count, 6)))
    found.state[:], found.nuisance[:], found.left[:] = CONVERGED, 1, left
    found.cubic[:], found.bending[:] = 0.02 * left[:, None], 0
    known = ReferenceArgs(
        signal,
        np.full(count, 300.0),
        np.full((count, 2), 1e-4),
        np.full(count, 0.01),
        np.array([100.0, 50.0]),
        5.0,
        1.0,
        np.full(count, 1e3),
        0.5,
    )
    return found, known


def test_the_common_error_follows_the_contrast_and_ignores_those_that_stand_out() -> None:
    rng = np.random.default_rng(1)
    signal = rng.uniform(500, 1500, 800)
    left = 2 + 0.01 * signal
    left[::10] *= 9
    found, known = zois(800, left, signal)
    common = pooled(found, left, np.ones(800), known, np.arange(800), given=True)
    assert common is not None
    assert common.ratio == pytest.approx(2 + 0.01 * signal, rel=0.12)
    assert common.colour == pytest.approx([2.0, 4.0], rel=0.02)
    assert np.array_equal(common.forgiven, common.ratio)


def test_what_a_usual_zoi_bends_and_how_much_the_picture_is_stretched() -> None:
    found, known = zois(200, np.full(200, 2.0), np.full(200, 900.0))
    white = 0.83 * 5.0 * 2e-4 * 2.0  # median of b^2: 5 times the variances of u and v
    found.bending[:] = 3 * white
    found.bending[::9] *= 50  # that few stand out
    usual = pooled(found, found.left, np.ones(200), known, np.arange(200), given=False)
    assert usual is not None and usual.bent == pytest.approx(3, rel=0.02)
    found.nuisance[:, 0] = 0.5  # half of the contrast: noise moves everything twice as far
    dim = pooled(found, found.left, np.ones(200), known, np.arange(200), given=False)
    assert dim is not None and dim.bent == 1
    found.nuisance[:, 0], found.p[:, 1] = (
        1,
        1.0,
    )  # stretched to twice its length: half of the noise of half of it
    stretched = pooled(found, found.left, np.ones(200), known, np.arange(200), given=False)
    assert stretched is not None and stretched.colour / usual.colour == pytest.approx(1 / 0.75, rel=0.02)


@pytest.mark.parametrize("slope", [0.0, 0.05])
@pytest.mark.parametrize(("du_dx", "dv_dy"), [(0.4, 0.3), (-0.25, -0.2)])
def test_noise_of_a_stretched_picture_is_a_mean_over_more_pixels(
    du_dx: float, dv_dy: float, slope: float
) -> None:
    """Nothing but the noise of the deformed picture: its uncertainty goes with the root of det F."""
    motion, rng = {"du_dx": du_dx, "dv_dy": dv_dy}, np.random.default_rng(7)
    still, moved = (200 * Speckle(2.5, 3, span=500).at(*affine(SHAPE, **m)) for m in ({}, motion))
    quiet, noise = NoiseModel(slope * 1e-3, 0.05), NoiseModel(slope, 2.0)
    zois = ZoiGrid.cover(Roi(88, 88, 144, 144), 48, 24)
    x, y = np.meshgrid(zois.x - (SHAPE[1] - 1) / 2, zois.y - (SHAPE[0] - 1) / 2)
    start = StrainField.from_values(zois, {"u": du_dx * x, "v": dv_dy * y, **motion})
    kernel, off = PhaseKernel(still.astype(np.float32), zois, noise=quiet), []
    for _ in range(12):
        later = moved + rng.normal(0, 1, SHAPE) * np.sqrt(noise.variance(moved))
        field = kernel.measure(later.astype(np.float32), start=start, noise=noise)
        for name, truth in (("u", du_dx * x), ("v", dv_dy * y), ("du_dx", du_dx), ("dv_dy", dv_dy)):
            off.append(((field.value(name) - truth) / field.sigma(name))[field.ok])
    assert np.sqrt(np.mean(np.concatenate(off) ** 2)) == pytest.approx(1, abs=0.06)


def test_what_those_that_do_not_bend_decide_has_no_step() -> None:
    """They decide alone where they are white, and less and less the more colour they show."""
    rng, count = np.random.default_rng(3), 600
    straight = np.arange(count) % 3 == 0
    left = np.where(straight, 2.0, 8.0) * rng.uniform(0.95, 1.05, count)
    found, known = zois(count, left, np.full(count, 900.0))
    forgiven, apart = [], []
    for colour in np.linspace(1.0, 1.7, 141):
        found.cubic[:] = colour * 1e-4 * known.white * left[:, None]
        found.bending[:] = 1e-4 * left * np.where(straight, 1.0, 1e4)
        common = pooled(found, left, np.ones(count), known, np.arange(count), given=False)
        assert common is not None
        forgiven.append(float(np.median(common.forgiven)))
        apart.append(common.apart)
    assert forgiven[0] == pytest.approx(2.0, rel=0.02) and forgiven[-1] == pytest.approx(8.0, rel=0.05)
    assert np.abs(np.diff(np.log(forgiven))).max() < 0.06
    assert apart[0] and not apart[-1]


def test_medians_are_compiled_once_for_any_order_in_memory() -> None:
    rows = np.random.default_rng(3).normal(size=(3, 5000))
    for one in (rows, np.asfortranarray(rows), rows[:, ::2]):
        np.testing.assert_array_equal(pooling.medians(one), np.median(one, axis=1))
    assert len(pooling.row_medians.signatures) == 1


def test_given_noise_stands_where_what_is_left_agrees_and_few_zois_decide_nothing() -> None:
    signal = np.full(200, 900.0)
    found, known = zois(200, np.full(200, 0.9), signal)
    agreed = pooled(found, found.left, np.ones(200), known, np.arange(200), given=True)
    assert agreed is not None and (agreed.ratio == 1).all()
    assert agreed.forgiven == pytest.approx(np.full(200, 0.9))
    free = pooled(found, found.left, np.ones(200), known, np.arange(200), given=False)
    assert free is not None and free.ratio == pytest.approx(np.full(200, 0.9))
    few, of_few = zois(20, np.full(20, 9.0), np.full(20, 900.0))
    assert pooled(few, few.left, np.ones(20), of_few, np.arange(20), given=True) is None
    unlike, of_unlike = zois(200, np.full(200, 800.0), signal)
    assert pooled(unlike, unlike.left, np.ones(200), of_unlike, np.arange(200), given=True) is None


def test_the_answer_of_the_shapes_to_white_noise_is_that_of_many_pictures() -> None:
    clean = picture(0, 1).astype(np.float32)
    kernel = PhaseKernel(clean, GRID, noise=0.1)
    reference, rng, found = kernel.reference, np.random.default_rng(3), []
    from analysis.kernel.images import as_model
    from analysis.kernel.solve import Solution

    for _ in range(12):
        noisy = clean + rng.normal(0, 2, SHAPE).astype(np.float32)
        solution = Solution(reference, noisy, as_model(2.0), np.zeros((len(reference.index), 6)))
        found.append(solution.found.cubic / (4 * reference.share_variance))
    expected = white_cubic(reference.prepared, 32, 1, reference.share_variance)
    assert np.median(np.concatenate(found), axis=0) == pytest.approx(expected, rel=0.08)


@pytest.mark.parametrize("fine", [True, False])
def test_an_error_that_is_not_white_counts_by_its_frequencies(fine: bool) -> None:
    clean = picture(0, 1).astype(np.float32)
    kernel, rng, observed, predicted = PhaseKernel(clean, GRID, noise=1.3), np.random.default_rng(4), [], []
    names = ("u", "v", "du_dx", "du_dy", "dv_dx", "dv_dy")
    for _ in range(6):
        noise = rng.normal(0, 3, SHAPE)
        error = (
            noise - cv2.GaussianBlur(noise, (0, 0), 1.0) if fine else 3 * cv2.GaussianBlur(noise, (0, 0), 2.0)
        )
        field = kernel.measure((clean + error).astype(np.float32), noise=2.2 if fine else 1.3)
        assert field.ok.mean() > 0.99
        observed.append([np.nanmean(field.value(n) ** 2) for n in names])
        predicted.append([np.nanmean(field.sigma(n) ** 2) for n in names])
    ratio = np.sqrt(np.mean(predicted, axis=0) / np.mean(observed, axis=0))
    assert ratio == pytest.approx(np.ones(6), abs=0.07), ratio


def test_noise_is_not_below_the_rounding_of_the_picture() -> None:
    step = 16 * np.arange(64, dtype=np.uint8).reshape(8, 8) // 4
    assert rounding_variance(step) == pytest.approx(16 / 12)
    assert rounding_variance(step + np.float32(0.5)) == 0
    image = picture(0, 1)
    field = PhaseKernel(image, GRID).measure(image)
    assert np.abs(field.u).max() < 1e-5
    shared = PhaseKernel(image, GRID, noise=12**-0.5).measure(image, noise=12**-0.5)
    assert field.sigma_u == pytest.approx(shared.sigma_u, rel=0.2)


def test_an_uncertainty_grows_with_the_stretch() -> None:
    stretch = {"du_dx": 0.4, "dv_dy": -0.1}
    x, y = np.meshgrid(GRID.x - 159.5, GRID.y - 159.5)
    inner = GRID.subset(active=(np.abs(x) < 70) & (np.abs(y) < 120))
    start = StrainField.from_values(inner, {"u": 0.4 * x, "v": -0.1 * y, "du_dx": 0.4, "dv_dy": -0.1})
    first, still = picture(2, 1), picture(2, 2)
    kernel = PhaseKernel(first, inner, noise=2.02)
    stretched = kernel.measure(picture(2, 3, **stretch), start=start, noise=2.02)
    unmoved = kernel.measure(still, noise=2.02)
    assert stretched.ok[inner.active].mean() > 0.95
    both = stretched.ok & unmoved.ok
    for name, factor in {"u": 1.4, "du_dy": 1.4, "v": 0.9, "dv_dy": 0.9}.items():
        ratio = np.median(stretched.sigma(name)[both] / unmoved.sigma(name)[both])
        assert ratio == pytest.approx(factor, rel=0.1), name


@pytest.mark.parametrize("kind", [np.uint8, np.float32])
def test_wild_pixels_are_replaced(kind: type) -> None:
    clean, rng = picture(1, 1), np.random.default_rng(4)
    assert without_impulses(clean) is None
    where = rng.random(SHAPE) < 0.003
    spoilt = np.where(where, np.uint8(255), clean).astype(kind)
    found = without_impulses(spoilt)
    assert found is not None and found.dtype == kind
    assert np.mean(np.abs(found.astype(float) - clean)[where] < 25) > 0.9
    assert np.mean(found[~where] == spoilt[~where]) > 0.9998


def test_hot_pixels_that_stand_still_do_not_pull() -> None:
    hot = np.random.default_rng(4).random(SHAPE) < 0.003
    images = [np.where(hot, np.uint8(255), picture(1, k, **(MOTION if k else {}))) for k in (0, 1)]
    field = PhaseKernel(images[0], GRID).measure(images[1])
    assert field.ok.mean() > 0.97
    assert np.sqrt(np.mean((field.u - MOTION["u"])[field.ok] ** 2)) < 0.02


def test_spectra_of_the_reference_are_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of the ZOIs that were looked at last: they are the same in the next picture, and no value depends on it."""
    images = [picture(5, k, **MOTION) for k in (2, 3)]  # all ZOIs have values
    calls: list[int] = []
    spectra = coloured._spectra
    monkeypatch.setattr(coloured, "_spectra", lambda *given: calls.append(1) or spectra(*given))
    kernel, fields, counts = PhaseKernel(picture(1, 0), GRID, noise=1.0), [], []
    for image in images:
        fields.append(kernel.measure(image, noise=1.0))
        counts.append(len(calls))
        calls.clear()
    alone = PhaseKernel(picture(1, 0), GRID, noise=1.0).measure(images[1], noise=1.0)
    assert alone.picture is not None and alone.picture.cause
    np.testing.assert_array_equal(fields[1].parameters, alone.parameters)
    np.testing.assert_array_equal(fields[1].covariance, alone.covariance)
    assert counts[0] - counts[1] == 2 and len(kernel.reference.kept) == 1


def test_blocks_are_seen_wherever_they_begin() -> None:
    raw = picture(1, 1)
    assert blockiness(raw) < 1.1
    assert blockiness(jpeg(raw, 80)[3:, 5:]) > BLOCKS


def lines(image: np.ndarray, seed: int) -> np.ndarray:
    return image + np.random.default_rng(seed).normal(0, 4, (SHAPE[0], 1))


@pytest.mark.parametrize(
    ("cause", "spoilt"),
    [
        ("noise", lambda image: image + np.random.default_rng(9).normal(0, 5, SHAPE)),
        (
            "filter",
            lambda image: (
                image + 4 * cv2.GaussianBlur(np.random.default_rng(9).normal(0, 3, SHAPE), (0, 0), 1)
            ),
        ),
    ],
)
def test_the_cause_of_an_error_is_named(cause: str, spoilt) -> None:
    later = spoilt(picture(1, 2, **MOTION).astype(np.float64)).astype(np.float32)
    field = PhaseKernel(picture(1, 1), GRID, noise=1.04).measure(later, noise=1.04)
    assert field.picture is not None and field.picture.cause == cause
    assert field.picture.factor > 1.5
    assert np.mean(field.status == Status.OK) > 0.97


def test_bands_and_lines_are_taken_off_whatever_way_they_run() -> None:
    first, clean = picture(1, 1), picture(1, 2, **MOTION).astype(np.float32)
    kernel = PhaseKernel(first, GRID, noise=1.04)
    wave = 10 * np.sin(2 * np.pi * np.arange(SHAPE[0]) / 23).astype(np.float32)
    for later in (clean + wave[:, None], clean + wave, lines(clean, 9).astype(np.float32)):
        field = kernel.measure(later, noise=1.04)
        assert field.picture is not None and field.picture.cause == "bands" and field.picture.factor < 3
        assert field.ok.mean() > 0.99
        off = np.hypot(field.u - MOTION["u"], field.v - MOTION["v"])[field.ok]
        assert np.sqrt(np.mean(off**2)) < 0.02


def test_mean_strain_and_sharpness_of_compressed_pictures() -> None:
    images = [jpeg(picture(1.5, k, **(MOTION if k else {})), 50) for k in (0, 1)]
    field = PhaseKernel(images[0], GRID).measure(images[1])
    means = [field.mean(name) for name in ("exx", "eyy")]
    assert all(abs(mean) < 3 * sigma for mean, sigma in means)
    assert abs(mean_blur(field).px) < 0.2


def grainy(noise: float, grain: float, seed: int, **motion: float) -> np.ndarray:
    """A pattern of 3 px blobs with noise of grains of a size, px."""
    rng = np.random.default_rng(seed)
    added = cv2.GaussianBlur(rng.normal(0, 1, SHAPE), (0, 0), grain)
    level = 128 + 255 * (Speckle(3.0, 1, span=400).at(*affine(SHAPE, **motion)) - 0.5)
    level += noise * added / added.std() + rng.normal(0, 0.5, SHAPE)
    return np.clip(np.rint(level), 0, 255).astype(np.uint8)


def test_grainy_noise_of_the_later_picture_alone_is_not_taken_for_that_of_both() -> None:
    kernel = PhaseKernel(grainy(0, 0.5, 1), GRID)
    field = kernel.measure(grainy(12, 0.5, 2, **MOTION))
    assert field.picture is not None and field.picture.cause == "filter"
    for name in ("u", "v", "exx", "eyy"):
        ratio = predicted_over_observed(field, name, MOTION.get(name, 0.0))
        assert ratio == pytest.approx(1, abs=0.12)  # it was 0.6 to 0.75
    mean, sigma = field.mean("exx")
    assert abs(mean) < 3 * sigma  # it was 9


@pytest.mark.parametrize("later", [0.0, 12.0])
def test_grainy_noise_of_the_reference_is_no_pattern(later: float) -> None:
    """Found: how much of the error is the reference's, and what it adds to the gradients that the fits rely on."""
    first = grainy(12, 1, 1)
    made = ReferencePicture.first(as_image(first, ""), GRID, KernelSettings(), None, None)
    image = as_recorded(grainy(later, 1, 2), "")
    solution = Solution(made, image, None, np.zeros((GRID.n_active, 6)))
    which = np.arange(GRID.n_active)
    own = own_error(made, which, left_by_fit(solution, which), "filter", 0.5)
    clean = 255 * Speckle(3.0, 1, span=400).at(*affine(SHAPE))
    for k, seen in enumerate(own.attenuation):
        found, true = made.prepared.images[k, : SHAPE[0], : SHAPE[1]], np.gradient(clean, axis=1 - k)
        assert seen == pytest.approx(np.mean(found * true) / np.mean(found**2), abs=0.1)
    assert own.moments[0] == pytest.approx(12**2, rel=0.15)


@pytest.mark.parametrize("stated", [None, 2.0])
def test_half_of_the_noise_is_that_of_the_reference(stated: float | None) -> None:
    """Where both pictures have the same, whether it is stated or not; so much of it all later fields have in common."""
    field = PhaseKernel(picture(2.0, 1), GRID, noise=stated).measure(picture(2.0, 2, **MOTION), noise=stated)
    of_reference = field.covariance_reference[0][field.ok] / field.covariance[0][field.ok]
    assert np.median(of_reference) == pytest.approx(0.5, abs=0.05)


def test_a_colour_that_few_zois_show_is_nearer_to_white() -> None:
    """With a chance of 1 / sqrt(n) in its logarithm: all of it of many ZOIs, none where it is within chance."""
    log = np.log(2.0)
    few, many = (float(pooling._shrunk(np.array([2.0]), n)[0]) for n in (9.0, 1e6))
    assert many == pytest.approx(2, rel=1e-5)
    assert np.log(few) == pytest.approx(log * (1 - (1 / 9) / log**2))
    assert pooling._shrunk(np.array([1.3, 0.8]), 9.0).tolist() == [1.0, 1.0]


@pytest.mark.parametrize("count", [1, 2, 25, 2047, 2048, 18_001])
def test_medians_of_many_are_exact(count: int) -> None:
    """Also where the sample that shows about where they are misleads, and where most values are equal."""
    rng = np.random.default_rng(count)
    even, sampled = rng.normal(size=count), np.arange(count) % max(count // pooling.SAMPLE, 1) == 0
    cases = even, np.sort(even), np.ones(count), np.rint(even), np.exp(5 * even), even + 9 * sampled
    for values in cases:
        assert pooling.median(values) == np.median(values)


def test_between_groups_holds_what_numpy_interpolates() -> None:
    x, at, values = np.linspace(-1, 6, 1001), np.array([0.0, 1.0, 1.0, 2.5, 5.0]), np.array([2.0, 1, 4, 4, 3])
    assert pooling._at(x, at, values) == pytest.approx(np.interp(x, at, values), rel=1e-14)
    assert pooling._at(x, at[:1], values[:1]).tolist() == [2.0] * len(x)


def test_quantisation_is_averaged_with_the_noise() -> None:
    assert NoiseModel(0.0, 2.0).averaged(4).floor == pytest.approx((4 + 1 / 12) / 4)
