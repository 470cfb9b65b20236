"""The limits of a valid ZOI by value: what a fit may leave, what a contrast may be, what counts as clipped."""

from __future__ import annotations

import numpy as np
import pytest

from analysis import KernelSettings, NoiseModel, PhaseKernel, Roi, Status, ZoiGrid
from analysis.evaluate import AreaGauge
from analysis.field import StrainField
from analysis.fit.kernel_args import LEFT_IMAGE, PooledError
from analysis.kernel.images import as_model
from analysis.kernel.neighbours import Neighbours
from analysis.kernel.reference import ReferencePicture
from analysis.kernel.solve import Solution
from tests.analysis.one_zoi import EXPECTED, FORGIVING, SIGNAL, verdict
from tests.analysis.speckle import SHAPE, picture

ALLOWED = FORGIVING * EXPECTED


@pytest.mark.parametrize(
    ("left", "status"),
    [
        (1.0 * EXPECTED, Status.OK),
        (ALLOWED + 0.0019 * SIGNAL, Status.OK),  # a fifth of a percent of the pattern beyond the noise
        (ALLOWED + 0.0021 * SIGNAL, Status.POOR_MATCH),
        (ALLOWED + 0.49 * SIGNAL, Status.POOR_MATCH),
        (ALLOWED + 0.51 * SIGNAL, Status.LOST),
        (float("nan"), Status.LOST),
    ],
)
def test_what_a_fit_may_leave(left: float, status: Status) -> None:
    assert verdict(left) == status


def usual(share: float) -> PooledError:
    """All ZOIs together leave that of what is expected."""
    return PooledError.none(1)._replace(forgiven=np.full(1, share))


def test_a_fit_that_leaves_more_than_its_like_stands_out_though_the_noise_would_allow_it() -> None:
    left = ALLOWED + 0.00196 * SIGNAL
    assert verdict(left, common=usual(0.999)) == Status.OK
    assert verdict(left, common=usual(0.9)) == Status.POOR_MATCH
    assert verdict(0.9 * ALLOWED + 0.00196 * SIGNAL, common=usual(0.9)) == Status.OK
    # A noise given far too high is not taken for what it seems to be: colour would scatter more.
    assert verdict(0.8 * ALLOWED + 0.00196 * SIGNAL, common=usual(0.3)) == Status.OK
    assert verdict(left, common=usual(0.9), known=False) == Status.OK


def test_unknown_noise_may_be_five_times_what_it_is_taken_for() -> None:
    assert verdict(5 * EXPECTED + 0.0019 * SIGNAL, known=False) == Status.OK
    assert verdict(5 * EXPECTED + 0.0021 * SIGNAL, known=False) == Status.POOR_MATCH


@pytest.mark.parametrize(
    ("gain", "status"),
    [(0.19, Status.POOR_MATCH), (0.21, Status.OK), (4.9, Status.OK), (5.1, Status.POOR_MATCH)],
)
def test_a_contrast_from_a_fifth_to_five_times(gain: float, status: Status) -> None:
    assert verdict(EXPECTED, gain=gain) == status


def test_a_fit_that_left_the_image_or_did_not_end() -> None:
    for left in (EXPECTED, ALLOWED + 0.51 * SIGNAL):
        assert verdict(left, state=LEFT_IMAGE) == Status.OUTSIDE
    assert verdict(EXPECTED, state=0) == Status.NOT_CONVERGED


GRID = ZoiGrid.cover(Roi(8, 8, 208, 168), size=32, step=16)


def saturated(share: float) -> np.ndarray:
    """Columns of the picture on the left part of the window of the ZOI in the middle, about ``share`` of it."""
    line = np.exp(-0.5 * (6 * (np.arange(32) - 15.5) / 32) ** 2)
    columns = int(np.searchsorted(np.cumsum(line) / line.sum(), share))
    mask = np.zeros(SHAPE, bool)
    mask[:, : GRID.first_x[6] + columns] = True
    return mask


@pytest.mark.parametrize(("share", "status"), [(0.045, Status.OK), (0.08, Status.CLIPPED)])
def test_a_twentieth_of_the_weight_may_be_clipped(share: float, status: Status) -> None:
    kernel = PhaseKernel(picture(), GRID, noise=4.0)
    assert kernel.measure(picture(), clipped=saturated(share)).status[5, 6] == status


@pytest.mark.parametrize(("share", "status"), [(0.045, Status.OK), (0.08, Status.CLIPPED)])
def test_a_twentieth_of_the_weight_may_be_clipped_in_the_reference(share: float, status: Status) -> None:
    kernel = PhaseKernel(picture(), GRID, noise=4.0, clipped=saturated(share))
    assert kernel.measure(picture()).status[5, 6] == status


def test_clipping_is_looked_up_where_the_zoi_is_now() -> None:
    """The specimen has moved by a window to the right; a glare stays where it was."""
    kernel, image = PhaseKernel(picture(), GRID, noise=4.0), picture(u=32.0)
    start = StrainField.from_values(GRID, {"u": 32.0}, 1e-3)
    glare = np.zeros(SHAPE, bool)
    glare[:, GRID.first_x[4] : GRID.first_x[4] + 32] = True
    field = kernel.measure(image, start=start, clipped=glare)
    inside = field.status[:, :9]  # the others have left the picture
    assert (inside[:, 2] == Status.CLIPPED).all()
    assert (inside[:, [0, 5, 6, 7]] == Status.OK).all()


def test_the_noise_model_marks_saturated_pixels() -> None:
    model = NoiseModel(0.0, 4.0, saturation=4000)
    image = picture().copy()
    image[60:110, 60:110] = 4000
    kernel = PhaseKernel(picture(), GRID, noise=model)
    still = kernel.measure(picture(), noise=model)
    assert kernel.measure(image, start=still, noise=model).status[4, 4] == Status.CLIPPED
    image[60:110, 60:110] = 3999
    assert kernel.measure(image, start=still, noise=model).status[4, 4] != Status.CLIPPED


def test_a_neighbour_lends_what_it_predicts_at_the_place_of_the_lost_zoi() -> None:
    """A lost ZOI amid a field of gradients gets the displacement of that field there."""
    reference = ReferencePicture.first(picture().astype(np.float32), GRID, KernelSettings(), 4.0, None)
    x, y = (a.ravel() for a in np.meshgrid(GRID.x, GRID.y))
    field = np.stack([1 + 0.01 * x + 0.02 * y, 0 * x + 0.01, 0 * x + 0.02,
                      2 - 0.03 * x + 0.005 * y, 0 * x - 0.03, 0 * x + 0.005], axis=1)  # fmt: skip
    solution = Solution(reference, picture(), as_model(4.0), np.zeros_like(field))
    solution.found.p[:], solution.status[:] = field, Status.OK
    for lost in (GRID.shape[1] + 1, 0, len(field) - 1):
        solution.status[:] = Status.OK
        solution.status[lost] = Status.LOST
        guess, lenders = Neighbours.of(reference).lent(
            solution, np.array([lost]), solution.status == Status.OK
        )
        assert guess[0] == pytest.approx(field[lost], abs=1e-9)
        assert lenders[0] == (8 if lost == GRID.shape[1] + 1 else 3)


@pytest.mark.parametrize(("lost", "known"), [(4, True), (5, False)])
def test_a_gauge_has_a_value_while_half_of_its_zois_have_one(lost: int, known: bool) -> None:
    status = np.zeros(GRID.shape, int)
    status.ravel()[:lost] = Status.LOST
    field = StrainField.from_values(GRID, {"dv_dy": 1e-3}, 1e-5, status)
    gauge = AreaGauge("", (GRID.x[0] - 1, GRID.y[0] - 1, 7 * 16 + 2, 2))
    assert gauge.zois(GRID)[0].sum() == 8
    assert np.isfinite(gauge.measure(field).value) == known


def test_poor_match_needs_no_picture_of_another_specimen() -> None:
    """A tenth of another pattern in a third of the ZOIs: neither lost nor valid; in all, the picture's own error."""
    kernel = PhaseKernel(picture(), GRID, noise=2.0)
    mixed = 0.9 * picture().astype(np.float32) + 0.1 * picture(v=60.0).astype(np.float32)
    everywhere = kernel.measure(mixed, noise=2.0)
    mixed[:, 80:] = picture()[:, 80:]
    status = kernel.measure(mixed, noise=2.0).status
    inside = GRID.x + 16 < 80
    assert inside.sum() >= 3
    assert np.mean(status[:, inside] == Status.POOR_MATCH) > 0.9
    assert (status[:, GRID.x - 16 >= 80] == Status.OK).all()
    still = kernel.measure(picture(), noise=2.0)
    assert np.nanmedian(everywhere.sigma_u) > 3 * np.nanmedian(still.sigma_u)
