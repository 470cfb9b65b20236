"""The filter of the reference works some rows at a time: the values are those of the whole picture at once."""

from __future__ import annotations

import numpy as np
import pytest

from analysis import KernelSettings, NoiseModel, Roi, ZoiGrid
from analysis.kernel import prepared
from analysis.kernel.images import as_image, padded_room
from analysis.kernel.prepared import prepare_reference
from analysis.picture import spectrum
from analysis.picture.spectrum import filtered_pattern, radial_spectrum
from tests.analysis.speckle import picture


def test_filter_and_gradients_are_those_of_one_transform() -> None:
    """Of a picture whose own periodic continuation is that of its rim."""
    image = as_image(picture(), "the picture")
    whole = filtered_pattern(image, 1.0, 5)
    out = padded_room(3, image.shape)[:, : image.shape[0], : image.shape[1]]
    given = filtered_pattern(image, 1.0, 5, (out[0], out[1], out[2]))
    for name in ("grad_x", "grad_y", "level"):
        assert np.array_equal(getattr(whole, name), getattr(given, name))
    assert given.level.base is out.base
    inner = np.s_[3:-3, 3:-3]
    along = np.gradient(whole.level, axis=1)[inner], np.gradient(whole.level, axis=0)[inner]
    for of, differences in zip((whole.grad_x, whole.grad_y), along, strict=True):
        assert np.corrcoef(of[inner].ravel(), differences.ravel())[0, 1] > 0.98


@pytest.mark.parametrize("rows", [1, 7, 10_000])
def test_it_does_not_matter_how_many_rows_are_taken_at_a_time(
    rows: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    image = as_image(picture()[:101, :93], "the picture")
    spectrum._rings.cache_clear()
    before, rings = filtered_pattern(image, None, 5), radial_spectrum(image)
    monkeypatch.setattr(spectrum, "_ROWS", rows)
    spectrum._rings.cache_clear()
    after, again = filtered_pattern(image, None, 5), radial_spectrum(image)
    spectrum._rings.cache_clear()
    for name in ("grad_x", "grad_y", "level", "own_noise", "left_gradient", "left_level", "noise"):
        assert np.array_equal(getattr(before, name), getattr(after, name))
    assert all(np.array_equal(one, other) for one, other in zip(rings, again, strict=True))


@pytest.mark.parametrize("noise", [None, NoiseModel(0.05, 1.0)])
def test_matrices_are_the_same_however_many_zois_are_taken_at_a_time(
    noise: NoiseModel | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also of ZOIs that are not in rows, as those of a renewed reference."""
    image = as_image(picture(), "the picture")
    grid = ZoiGrid.cover(Roi(0, 0, image.shape[1], image.shape[0]), size=21, step=9)
    rows, columns = np.unravel_index(np.arange(grid.active.size), grid.shape)
    origins = np.stack([grid.first_y[rows], grid.first_x[columns]], axis=1).astype(np.int64)
    origins[:, 0] += (columns % 3) * (origins[:, 0] + 24 < image.shape[0])
    made = []
    for sides in (1, 4, 1000):
        monkeypatch.setattr(prepared, "ROWS_OF_ZOIS", sides)
        made.append(prepare_reference(image, origins, 21, KernelSettings(), noise))
    for name in ("inverse", "cross", "covariance", "covariance_level", "energy", "freedom", "blur", "bias"):
        first, *others = (getattr(one, name) for one in made)
        assert (
            all(np.array_equal(first, other) for other in others)
            if first is not None
            else others == [None, None]
        )


def test_frequencies_that_are_left_out_are_those_that_the_filter_does_not_pass() -> None:
    gain = np.array([0.0, 0.1, 0.2, 0.31, 0.4]), np.array([1.0, 0.9, 0.5, 0.0, 0.0])
    for length in (40, 101, 1350):
        share = np.interp(np.arange(length // 2 + 1) / length, *gain)
        assert spectrum._passed(gain, length) == np.count_nonzero(share)
    assert [spectrum._passed((gain[0], of), 101) for of in (np.ones(5), np.zeros(5))] == [41, 11]
