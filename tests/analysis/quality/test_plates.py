"""Plates beside a specimen are found by their boxes; what is round, coarse or elsewhere is not clear."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.field import Roi
from analysis.quality.specimen import Specimen, _beside, _is_plate, find_plates, find_specimen
from hw_mocks.scene import Scene
from hw_mocks.specimen import VirtualSpecimen

SPECIMEN, LEFT, RIGHT = (240, 20, 160, 440), (50, 110, 110, 260), (480, 110, 110, 260)
WALL, NOISE = 60.0, 1.0


def pattern(radius: float = 2.0) -> NDArray[np.float64]:
    return np.asarray(Scene(VirtualSpecimen(width=640, height=480), radius).render(0.0), np.float64) * 250


def scene(*boxes: tuple[int, int, int, int], radius: float = 2.0) -> NDArray[np.float64]:
    """The specimen, and ``boxes`` of a pattern of ``radius``, before an even wall."""
    picture = np.full((480, 640), WALL)
    for box, of in ((SPECIMEN, pattern()), *((box, pattern(radius)) for box in boxes)):
        x, y, w, h = box
        picture[y : y + h, x : x + w] = of[y : y + h, x : x + w]
    return picture + np.random.default_rng(1).normal(0, NOISE, picture.shape)


def found(picture: NDArray[np.float64]) -> tuple[list[tuple[int, ...]], int]:
    specimen = find_specimen(picture, NOISE)
    assert specimen is not None
    assert abs(specimen.box.x - SPECIMEN[0]) < 12
    plates = find_plates(picture, specimen, NOISE)
    return [(box.x, box.y, box.width, box.height) for box in plates.plates], len(plates.unclear)


@pytest.mark.parametrize("boxes", [(LEFT, RIGHT), (RIGHT,), ()])
def test_plates_by_their_boxes(boxes: tuple[tuple[int, int, int, int], ...]) -> None:
    plates, unclear = found(scene(*boxes))
    assert unclear == 0
    assert len(plates) == len(boxes)
    for plate, box in zip(plates, boxes, strict=True):
        np.testing.assert_allclose(plate, box, atol=14)


def test_lying_specimens_too() -> None:
    picture = scene(LEFT, RIGHT).T
    specimen = find_specimen(picture, NOISE)
    assert specimen is not None
    plates = find_plates(picture, specimen, NOISE).plates
    assert [abs(box.y - y) < 14 for box, (y, *_) in zip(plates, (LEFT, RIGHT), strict=True)] == [True, True]


def test_a_short_one_and_a_coarse_one_are_not_clear() -> None:
    assert found(scene((50, 110, 110, 120))) == ([], 1)
    assert found(scene(LEFT, radius=5.0)) == ([], 1)


def test_a_round_one_is_not_clear() -> None:
    picture = scene(LEFT)
    y, x = np.mgrid[:480, :640]
    outside = (np.hypot((x - 105) / 55, (y - 240) / 130) > 1) & (x < 200)
    picture[outside] = WALL
    assert found(picture) == ([], 1)


UPRIGHT = Roi(100, 50, 30, 200)


def turned(box: Roi) -> Roi:
    return Roi(box.y, box.x, box.height, box.width)


@pytest.mark.parametrize(
    ("box", "beside"),
    [
        (Roi(70, 50, 30, 80), True),  # two fifths of the length, side by side
        (Roi(70, 50, 30, 79), False),
        (Roi(71, 50, 30, 80), False),  # one pixel within it
        (Roi(130, 170, 30, 100), True),
        (Roi(130, 171, 30, 100), False),
        (Roi(129, 170, 30, 100), False),
        (Roi(70, 0, 30, 130), True),
        (Roi(70, 0, 30, 129), False),
        (Roi(100, 260, 30, 200), False),  # below
    ],
)
def test_a_plate_lies_along_two_fifths_of_the_specimen(box: Roi, beside: bool) -> None:
    assert _beside(box, UPRIGHT) is beside
    assert _beside(turned(box), turned(UPRIGHT)) is beside


@pytest.mark.parametrize(
    ("missing", "radius", "plate"),
    [(20, 2.0, True), (21, 2.0, False), (0, 2.99, True), (0, 3.01, False), (0, 1.34, True), (0, 1.33, False)],
)
def test_a_plate_fills_its_box_with_speckle_of_the_specimen(missing: int, radius: float, plate: bool) -> None:
    """Of 200 pixels, nine in ten; a speckle of 2 px half as large again, or two thirds of it."""
    mask = np.zeros((20, 40), bool)
    mask[:, 10:20] = True
    mask.ravel()[np.flatnonzero(mask)[:missing]] = False
    specimen = Specimen(np.ones((20, 40), bool), Roi(25, 0, 10, 20), 2.0)
    assert _is_plate(Specimen(mask, Roi(10, 0, 10, 20), radius), specimen) is plate
