"""A lens from corners of made-up boards, and the part that was calibrated."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import pytest

from acquire.errors import DataError
from live.setup import lens as module
from live.setup.lens import _box, from_boards, lens_of_corners
from live.setup.scale import (
    Board,
    Corners,
)
from tests.live.test_lens import FOCAL, MIDDLE, TRUE, VIEWS

ROW_COLUMN = np.mgrid[:6, :8].reshape(2, -1).T
MM = 10.0 * ROW_COLUMN[:, ::-1] - [35.0, 25.0]
NOISE_PX = 0.1


def corners(terms: np.ndarray = TRUE.parameters[3:]) -> list[Corners]:
    """Of ten views of a board, with noise in x and in y."""
    rng, flat = np.random.default_rng(5), np.column_stack([MM, np.zeros(len(MM))])
    camera = np.array([[FOCAL, 0, MIDDLE[0]], [0, FOCAL, MIDDLE[1]], [0, 0, 1]])
    found = []
    for turn, place in VIEWS:
        px = cv2.projectPoints(flat, np.radians(turn), np.array(place, float), camera, terms)[0][:, 0]
        found.append(Corners(MM, px + rng.normal(0, NOISE_PX, px.shape)))
    return found


def test_what_a_fit_leaves_is_the_noise_of_one_coordinate() -> None:
    fit = lens_of_corners(corners(), (480, 360))
    assert fit.rms_px == pytest.approx(NOISE_PX, rel=0.1)
    sigma = np.sqrt(np.diag(fit.lens.covariance))
    assert np.max(np.abs(fit.lens.parameters - TRUE.parameters)[:7] / sigma[:7]) < 4
    assert (fit.lens.parameters[7], sigma[7]) == (0.0, 0.0), "k3 is not fitted"


def test_the_term_of_sixth_order_is_fitted_where_asked_for() -> None:
    terms = TRUE.parameters[3:].copy()
    terms[4] = 6.0
    fit = lens_of_corners(corners(terms), (480, 360), k3=True)
    sigma = float(np.sqrt(fit.lens.covariance[7, 7]))
    assert 0 < sigma < 1.4 and abs(fit.lens.parameters[7] - 6.0) < 4 * sigma


def test_views_that_are_all_square_do_not_show_the_lens() -> None:
    still = [corners()[0]] * 5
    with pytest.raises(DataError, match="tilt the board by 10 to 30 degrees"):
        lens_of_corners(still, (480, 360))


@pytest.mark.parametrize(("shown", "enough"), [(5, True), (4, False)])
def test_five_pictures_must_show_the_board(monkeypatch: pytest.MonkeyPatch, shown: int, enough: bool) -> None:
    views = corners()[1:6]

    def find(picture: Any, board: Board) -> Corners:
        number = int(picture[0, 0])
        if number >= shown:
            raise DataError("no board")
        return views[number]

    monkeypatch.setattr(module, "find_corners", find)
    pictures = [np.full((360, 480), k, np.uint8) for k in range(7)]
    if not enough:
        with pytest.raises(DataError, match="4 of 7 pictures show the board; it takes 5"):
            from_boards(pictures, Board(8, 6, 10.0))
        return
    found = from_boards(pictures, Board(8, 6, 10.0))
    assert found.picture == (480, 360) and found.method == "checkerboard, 240 corners in 5 of 7 pictures"
    places = np.concatenate([view.px for view in views])
    left, top = np.maximum(places.min(axis=0), 0)
    right, bottom = places.max(axis=0)
    assert found.box == pytest.approx((left, top, right - left, bottom - top))
    changes = found.changes
    assert changes["lens.picture"] == [480, 360] and changes["lens.focal_px"] == pytest.approx(
        FOCAL, rel=0.05
    )
    assert changes["lens.centre"] == pytest.approx(MIDDLE, abs=15) and len(changes["lens.covariance"]) == 8
    assert changes["lens.k1"] == found.fit.lens.parameters[3] and changes["lens.k3"] == 0.0
    assert [changes[f"lens.{name}"] for name in ("k2", "p1", "p2")] == list(found.fit.lens.parameters[4:7])
    marked = from_boards(pictures, Board(9, 7, 10.0, 5.0))
    assert marked.method.startswith("ChArUco board, ")


def test_the_part_that_was_calibrated_is_about_all_places_and_in_the_picture() -> None:
    assert _box(np.array([[10.0, 50.0], [40.0, 20.0], [30.0, 30.0]])) == (10.0, 20.0, 30.0, 30.0)
    assert _box(np.array([[-3.0, -5.0], [40.0, 20.0]])) == (0.0, 0.0, 40.0, 20.0)
