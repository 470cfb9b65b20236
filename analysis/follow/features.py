"""Affine motions between two pictures from matched features: starts where no search finds the pattern again.

A large rotation or strain hides the pattern from a correlation, but not from SIFT keypoints (D. G. Lowe, Int. J.
Comput. Vis. 60 (2004) 91-110, doi:10.1023/B:VISI.0000029664.99615.94). The motions that many matches share are found
by RANSAC (M. A. Fischler, R. C. Bolles, Commun. ACM 24 (1981) 381-395, doi:10.1145/358669.358692).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.field import Roi

Floats = NDArray[np.float64]
Image = NDArray[np.float32]

MAX_FEATURES = 4000
"""The strongest ones of a picture."""
RATIO = 0.8
"""A match counts where its distance is below this share of that of the second best: none in a pattern that repeats."""
REACH_PX = 4.0
"""Matches that lie so near to an affine motion share it."""
MIN_SHARED = 12
"""Matches that make a motion."""
MOTIONS = 3
"""Motions that are tried at most."""


def feature_motions(reference: Image, deformed: Image, region: Roi) -> Iterator[Floats]:
    """The affine motions that features share, the commonest first.

    Parameters
    ----------
    reference, deformed : (H, W) float32, GL
    region : Roi
        Of the reference.

    Yields
    ------
    (2, 3) float64
        Takes (x, y, 1) of the reference to (x, y) in the deformed image, px.
    """
    import cv2

    here, there = _matches(reference, deformed, region)
    for _ in range(MOTIONS):
        if len(here) < MIN_SHARED:
            return
        matrix, shared = cv2.estimateAffine2D(here, there, method=cv2.RANSAC, ransacReprojThreshold=REACH_PX)
        if matrix is None or shared.sum() < MIN_SHARED:
            return
        if np.linalg.det(matrix[:, :2]) > 0:  # a mirrored specimen is none
            yield np.asarray(matrix, np.float64)
        rest = shared.ravel() == 0
        here, there = here[rest], there[rest]


def motion_at(matrix: Floats, x: NDArray[Any], y: NDArray[Any]) -> Floats:
    """An affine motion (2, 3) at some points, (N, 6): u, du_dx, du_dy, v, dv_dx, dv_dy, px and px per px."""
    gradient = matrix[:, :2] - np.eye(2)
    out = np.empty((len(x), 6))
    for r in (0, 1):
        out[:, 3 * r] = gradient[r, 0] * x + gradient[r, 1] * y + matrix[r, 2]
        out[:, 3 * r + 1 : 3 * r + 3] = gradient[r]
    return out


def _matches(reference: Image, deformed: Image, region: Roi) -> tuple[Image, Image]:
    """Places (N, 2) of features of the region, and of those in the deformed image that are like them and no others."""
    import cv2

    sift = cv2.SIFT.create(nfeatures=MAX_FEATURES)
    inside = np.zeros(reference.shape, np.uint8)
    inside[region.y : region.y + region.height, region.x : region.x + region.width] = 1
    points, described = sift.detectAndCompute(_bytes(reference), inside)
    others, like = sift.detectAndCompute(_bytes(deformed), None)
    if min(len(points), len(others)) < MIN_SHARED:
        return np.empty((0, 2), np.float32), np.empty((0, 2), np.float32)
    pairs = cv2.BFMatcher().knnMatch(described, like, k=2)
    good = [a for a, b in pairs if a.distance < RATIO * b.distance]
    here = np.array([points[m.queryIdx].pt for m in good], np.float32).reshape(-1, 2)
    there = np.array([others[m.trainIdx].pt for m in good], np.float32).reshape(-1, 2)
    return here, there


def _bytes(image: Image) -> NDArray[np.uint8]:
    """The grey levels between the 1st and the 99th percentile as 0 .. 255."""
    low, high = np.percentile(image[::4, ::4], (1, 99))
    return np.asarray(np.clip((image - low) * (255 / max(high - low, 1e-9)), 0, 255), np.uint8)
