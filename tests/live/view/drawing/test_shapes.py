"""What is drawn on the picture lies where it belongs."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.field.grid import Roi, ZoiGrid
from analysis.field.strain_field import StrainField
from live.view.drawing.shapes import (
    ArrowScale,
    centres,
    mean_motion,
    region_edges,
    sample_boxes,
    thinned,
    with_heads,
)
from tests.live.made_up import make_field, make_grid


def test_centres_are_half_a_pixel_further_in_the_viewer() -> None:
    grid = ZoiGrid.cover(Roi(10, 20, 100, 80), size=33, step=16)
    np.testing.assert_array_equal(centres(grid)[0, 0], [10 + 16 + 0.5, 20 + 16 + 0.5])


def test_sample_boxes_are_active_and_do_not_overlap() -> None:
    grid = ZoiGrid.cover(Roi(0, 0, 1000, 700), size=64, step=8)
    boxes = sample_boxes(grid)
    assert 4 <= len(boxes) <= 30
    apart = np.abs(boxes[:, None] - boxes[None]).max(axis=-1) + 1e9 * np.eye(len(boxes))
    assert apart.min() >= 64


def test_few_zois_are_all_shown() -> None:
    grid = ZoiGrid.cover(Roi(0, 0, 300, 300), size=40, step=100)
    assert len(sample_boxes(grid)) == grid.n_active


def test_very_many_points_are_thinned() -> None:
    grid = ZoiGrid.cover(Roi(0, 0, 1000, 1000), size=20, step=5)
    assert 1000 <= len(thinned(grid, np.ones(grid.shape, bool))) <= 2000
    assert len(thinned(grid, np.zeros(grid.shape, bool))) == 0


def test_the_maps_follow_the_specimen() -> None:
    grid = make_grid()
    x, y = np.meshgrid(grid.x, grid.y)
    values = {"u": 3.0 + 0.01 * x - 0.02 * y, "v": -1.0 + 0.03 * x + 0.05 * y}
    values |= {"du_dx": 0.01, "du_dy": -0.02, "dv_dx": 0.03, "dv_dy": 0.05}
    matrix, shift = mean_motion(StrainField.from_values(grid, values))
    place = np.array([40.0, 60.0, 0.0])
    half = np.array([0.5, 0.5, 0.0])
    moved = matrix @ (place + half) + shift - half
    expected = [40 + 3.0 + 0.4 - 1.2, 60 - 1.0 + 1.2 + 3.0, 0.0]
    np.testing.assert_allclose(moved, expected, atol=1e-9)


def test_nothing_measured_moves_nothing() -> None:
    grid = make_grid()
    field = StrainField.from_values(grid, {}, status=np.full(grid.shape, 5))
    matrix, shift = mean_motion(field)
    np.testing.assert_array_equal(matrix, np.eye(3))
    np.testing.assert_array_equal(shift, np.zeros(3))
    origins, vectors, factor = ArrowScale().arrows(field)
    assert (len(origins), len(vectors)) == (0, 0)
    assert factor > 0


@pytest.mark.parametrize("strain", [1e-4, 1e-3, 0.05])
def test_arrows_are_magnified_to_be_seen(strain: float) -> None:
    grid = ZoiGrid.cover(Roi(0, 0, 800, 800), size=64, step=16)
    origins, vectors, factor = ArrowScale().arrows(make_field(grid, strain))
    longest = np.hypot(*vectors.T).max()
    assert 10 < longest < 150
    assert len(origins) <= 300
    assert factor in {m * 10.0**k for m in (1, 2, 5) for k in range(-3, 4)}


def test_the_magnification_does_not_flicker() -> None:
    grid = make_grid()
    scale = ArrowScale()
    factors = {scale.arrows(make_field(grid, strain))[2] for strain in (1e-3, 1.01e-3, 0.98e-3, 0.7e-3)}
    assert len(factors) == 1


def test_the_edge_of_the_region() -> None:
    """Of a square ring of ZOIs: the outer square and the hole that no ZOI covers."""
    grid = ZoiGrid.cover(Roi(10, 20, 70, 70), size=20, step=10)
    active = np.ones(grid.shape, bool)
    active[1:-1, 1:-1] = False
    edges = region_edges(grid.subset(active=active))
    squares = {(10, 20, 80, 90): 4, (30, 40, 60, 70): 4}
    for (left, top, right, bottom), count in squares.items():
        corners = {(left, top), (right, top), (right, bottom), (left, bottom)}
        found = [e for e in edges.astype(int).tolist() if {tuple(e[0]), tuple(e[1])} <= corners]
        assert len(found) == count
    assert len(edges) == 8


def test_no_region_has_no_edge() -> None:
    grid = ZoiGrid.cover(Roi(10, 20, 70, 70), size=20, step=7)
    assert region_edges(grid.subset(active=np.zeros(grid.shape, bool))).shape == (0, 2, 2)


def test_an_arrow_has_its_head_at_its_tip() -> None:
    ((start, tip, left, again, right),) = with_heads(np.array([[10.0, 20.0]]), np.array([[0.0, 40.0]]))
    assert (*start, *tip, *again) == (10, 20, 10, 60, 10, 60)
    assert sorted([*left, *right]) == pytest.approx([4, 16, 48, 48])
