"""Analytic speckle, rendered in the deformed place.

A pattern is a sum of Gaussian blobs ``A exp(-rho^2 / (2 r^2))`` of either sign on mid-grey, one in
each cell of a jittered lattice, with the contrast asked for and no value near the ends of the scale.
The deformed image is computed from the blobs: ``deformed(x + u, y + v) = reference(x, y)``. No
image is ever interpolated, and nothing is shared with what measures.

Two roads, which check each other:

- ``exact``: each pixel is taken back to the reference plane by Newton's rule (to 1e-10 px) and all
  blobs are summed there in double precision. Some 0.1 s for 640x512; for tests.
- ``fast``: each blob is moved, deformed by the gradient at its centre and added to the image, some
  3 ms for 640x512. Exact for affine deformations up to rounding; see ``Speckle.fast``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acquire.cv2_loader import load_cv2
from hw_mocks.deformation import Affine, Deformation, Gradient

Array = NDArray[np.float64]
Image = NDArray[np.float32]
PITCH = 2.5  # lattice of the blobs, in radii
JITTER = 0.45  # of the lattice
REACH_FAST, REACH_EXACT = 5.0, 6.0  # blobs are cut there, in radii: 4e-6 and 2e-8 of the amplitude
LOWEST, HIGHEST = 0.04, 0.96  # part of full scale that the noise-free pattern keeps within
LANES = 8
ROUNDS = 100


@dataclass(frozen=True, slots=True)
class Hole:
    """A round hole through the pattern, with an edge as soft as the pattern.

    Attributes
    ----------
    x0, y0, radius : float, px
    level : float
        What is seen through it, part of full scale.
    softness : float, px
        Half-width of the edge.
    """

    x0: float
    y0: float
    radius: float
    level: float = 0.12
    softness: float = 0.8

    def cover(self, x: Array, y: Array) -> Array:
        """Part of a reference place (x, y) that is material, 0 to 1."""
        over = (np.hypot(x - self.x0, y - self.y0) - self.radius) / self.softness
        return np.asarray(0.5 * (1 + np.tanh(over)))


@dataclass(frozen=True, slots=True, eq=False)
class Blobs:
    """The speckles of a pattern in the reference plane.

    Attributes
    ----------
    x, y : (N,) float64, px
    amplitude : (N,) float64
        Part of full scale, signed.
    """

    x: Array
    y: Array
    amplitude: Array


class Speckle:
    """A pattern that can be rendered under any deformation.

    Parameters
    ----------
    shape : (H, W), px
        Of the images.
    radius : float, px
        r of a blob ``exp(-rho^2 / (2 r^2))``.
    contrast : float
        Standard deviation of the noise-free reference image, part of full scale.
    seed : int
    margin : float, px
        How far the pattern goes on outside of the image, for what moves in.
    hole : Hole or None
    mean : float
        Part of full scale.
    """

    def __init__(
        self,
        shape: tuple[int, int],
        radius: float = 2.0,
        *,
        contrast: float = 0.18,
        seed: int = 0,
        margin: float = 64.0,
        hole: Hole | None = None,
        mean: float = 0.5,
    ) -> None:
        self.shape, self.radius, self.hole, self.mean = shape, radius, hole, mean
        self._margin = margin
        self.blobs = self._within_scale(self._scatter(np.random.default_rng(seed)), contrast)

    def _scatter(self, rng: np.random.Generator) -> Blobs:
        """One blob of random sign in each cell of the lattice."""
        pitch = PITCH * self.radius
        reach = self._margin + REACH_EXACT * self.radius
        rows, columns = (math.ceil((side + 2 * reach) / pitch) for side in self.shape)
        r, c = np.mgrid[:rows, :columns].reshape(2, -1)
        jitter = rng.uniform(-JITTER, JITTER, (2, r.size))
        x, y = (pitch * (place + 0.5 + move) - reach for place, move in zip((c, r), jitter, strict=True))
        return Blobs(x, y, rng.choice(np.array([-1.0, 1.0]), r.size))

    def _within_scale(self, blobs: Blobs, contrast: float) -> Blobs:
        """Weaken blobs where like ones pile up, until no pixel leaves the scale."""
        limit = min(self.mean - LOWEST, HIGHEST - self.mean)
        for _ in range(ROUNDS):
            self.blobs = blobs
            pattern = self._plain()
            scale = contrast / float(np.std(pattern[self._inner()]))
            if float(np.max(np.abs(pattern))) * scale <= limit:
                return Blobs(blobs.x, blobs.y, blobs.amplitude * scale)
            blobs.amplitude[self._piled_up(pattern, limit / scale)] *= 0.9
        raise ValueError(
            f"a contrast of {contrast:g} does not fit between {LOWEST:g} and {HIGHEST:g} of full scale"
        )

    def _piled_up(self, pattern: Image, limit: float) -> NDArray[np.bool_]:
        """The blobs within a radius of which the pattern, of their sign, is beyond the limit."""
        cv2 = load_cv2()
        size = 2 * math.ceil(self.radius) + 1
        highest = cv2.dilate(pattern, np.ones((size, size), np.uint8))
        lowest = cv2.erode(pattern, np.ones((size, size), np.uint8))
        border = int(self._margin)
        column = np.clip(np.rint(self.blobs.x) + border, 0, pattern.shape[1] - 1).astype(int)
        row = np.clip(np.rint(self.blobs.y) + border, 0, pattern.shape[0] - 1).astype(int)
        beyond = np.where(self.blobs.amplitude > 0, highest[row, column], -lowest[row, column])
        return np.asarray(beyond > limit)

    def _plain(self) -> Image:
        """The sum of blobs over the image and its margin, without mean."""
        border = int(self._margin)
        shape = (self.shape[0] + 2 * border, self.shape[1] + 2 * border)
        return self._splat(Affine(border, border), shape, 0.0)

    def _inner(self) -> tuple[slice, slice]:
        border = int(self._margin)
        return slice(border, border + self.shape[0]), slice(border, border + self.shape[1])

    def reference(self) -> Image:
        """The undeformed pattern, (H, W) float32, part of full scale, by the fast road."""
        return self.fast(Affine())

    def render(
        self, deformation: Deformation, shape: tuple[int, int] | None = None, *, exact: bool = False
    ) -> Image | Array:
        """The pattern in the deformed place, (H, W), part of full scale; see ``fast`` and ``exact``."""
        return self.exact(deformation, shape) if exact else self.fast(deformation, shape)

    def fast(self, deformation: Deformation, shape: tuple[int, int] | None = None) -> Image:
        """Render by moving and deforming each blob.

        Parameters
        ----------
        deformation : Deformation
        shape : (H, W), px, optional
            That of the pattern by default.

        Returns
        -------
        (H, W) float32, part of full scale
            Against ``exact`` at r = 2 px and 18 % contrast, in parts of full scale (largest, rms):
            affine 2e-6, 2e-7; ``Wave(0.02, 128)`` 4e-5, 9e-6; woven at 0.2 % mean strain 7e-5,
            1.2e-5 and at 0.8 % 3e-4, 5e-5; hole at 0.8 % 5e-4, 2e-5. Where the gradient varies
            within a blob only its value at the centre is used.
        """
        blobs = self.blobs
        u, v = deformation.displacement(blobs.x, blobs.y)
        return self.fast_at(
            blobs.x + u, blobs.y + v, deformation.gradient(blobs.x, blobs.y), deformation, shape
        )

    def fast_at(
        self,
        x: Array,
        y: Array,
        gradient: Gradient,
        deformation: Deformation,
        shape: tuple[int, int] | None = None,
    ) -> Image:
        """``fast`` with the places of the blobs, px, and their gradients known already."""
        image = self._splat_at(x, y, gradient, shape or self.shape, self.mean)
        if self.hole is not None:
            self._cut_hole(image, deformation, self.hole)
        return image

    def _splat(self, deformation: Deformation, shape: tuple[int, int], level: float) -> Image:
        x, y = self.blobs.x, self.blobs.y
        u, v = deformation.displacement(x, y)
        return self._splat_at(x + u, y + v, deformation.gradient(x, y), shape, level)

    def _splat_at(
        self, x: Array, y: Array, gradient: Gradient, shape: tuple[int, int], level: float
    ) -> Image:
        from hw_mocks.speckle_loops import splat

        a, b, c, stretch = _metric(gradient, self.radius)
        reach = REACH_FAST * self.radius * stretch
        columns = LANES * math.ceil((2 * reach + 2) / LANES)
        border = columns + 2
        canvas = np.full((shape[0] + 2 * border, shape[1] + 2 * border), level, np.float32)
        amplitude = self.blobs.amplitude.astype(np.float32)
        splat(canvas, x + border, y + border, amplitude, a, b, c, reach, columns)
        return np.ascontiguousarray(canvas[border:-border, border:-border])

    def _cut_hole(self, image: Image, deformation: Deformation, hole: Hole) -> None:
        """Lay the background over the hole; its edge is taken back to the reference plane."""
        angles = np.linspace(0, 2 * math.pi, 73)
        x, y = hole.x0 + hole.radius * np.cos(angles), hole.y0 + hole.radius * np.sin(angles)
        u, v = deformation.displacement(x, y)
        x, y = x + u, y + v
        cx, cy = float(np.mean(x[1:])), float(np.mean(y[1:]))
        rho = np.hypot(x - cx, y - cy)
        near, far = max(float(rho.min()) - 4 * hole.softness, 0.0), float(rho.max()) + 4 * hole.softness
        top, left = max(math.floor(cy - far), 0), max(math.floor(cx - far), 0)
        part = image[top : math.ceil(cy + far) + 1, left : math.ceil(cx + far) + 1]
        rows, columns = np.arange(part.shape[0]) + top, np.arange(part.shape[1]) + left
        square = (rows[:, None] - cy) ** 2 + (columns - cx) ** 2
        part[square < near**2] = hole.level
        row, column = np.nonzero((square >= near**2) & (square <= far**2))
        back = taken_back(
            deformation, (column + left).astype(float), (row + top).astype(float), tolerance=1e-3
        )
        cover = hole.cover(*back).astype(np.float32)
        part[row, column] = hole.level + (part[row, column] - hole.level) * cover

    def exact(self, deformation: Deformation, shape: tuple[int, int] | None = None) -> Array:
        """Render by taking each pixel back to the reference plane.

        Parameters
        ----------
        deformation : Deformation
        shape : (H, W), px, optional
            That of the pattern by default.

        Returns
        -------
        (H, W) float64, part of full scale

        Raises
        ------
        ValueError
            The deformation cannot be inverted everywhere in the image.
        """
        height, width = shape or self.shape
        y, x = np.mgrid[:height, :width].astype(float).reshape(2, -1)
        return self.at(*taken_back(deformation, x, y)).reshape(height, width)

    def at(self, x: Array, y: Array) -> Array:
        """The reference pattern at any places, (N,) float64, part of full scale.

        Parameters
        ----------
        x, y : (N,) float64, px
        """
        from hw_mocks.speckle_loops import evaluate

        reach = REACH_EXACT * self.radius
        origin = -self._margin - 2 * reach
        rows, columns = (int((side - 2 * origin) / reach) + 1 for side in self.shape)
        r = np.clip((self.blobs.y - origin) // reach, 0, rows - 1).astype(np.int64)
        c = np.clip((self.blobs.x - origin) // reach, 0, columns - 1).astype(np.int64)
        order = np.argsort(r * columns + c, kind="stable")
        first = np.searchsorted((r * columns + c)[order], np.arange(rows * columns + 1))
        bx, by, amplitude = self.blobs.x[order], self.blobs.y[order], self.blobs.amplitude[order]
        places = np.ascontiguousarray(x, float), np.ascontiguousarray(y, float)
        bins = (rows, columns)
        sums = evaluate(*places, first, bx, by, amplitude, origin, reach, bins, self.radius, reach)
        pattern: Array = self.mean + sums
        if self.hole is None:
            return pattern
        return self.hole.level + (pattern - self.hole.level) * self.hole.cover(x, y)


def taken_back(deformation: Deformation, x: Array, y: Array, tolerance: float = 1e-10) -> tuple[Array, Array]:
    """Which reference places came to (x, y), by Newton's rule.

    Parameters
    ----------
    x, y : (N,) float64, px
    tolerance : float, px

    Raises
    ------
    ValueError
        No convergence: the deformation folds.
    """
    back_x, back_y = x.copy(), y.copy()
    for _ in range(50):
        u, v = deformation.displacement(back_x, back_y)
        miss_x, miss_y = x - back_x - u, y - back_y - v
        if max(np.max(np.abs(miss_x), initial=0), np.max(np.abs(miss_y), initial=0)) < tolerance:
            return back_x, back_y
        a, b, c, d = deformation.gradient(back_x, back_y)
        a, d = a + 1, d + 1
        determinant = a * d - b * c
        if not np.all(determinant > 0):
            break
        back_x += (d * miss_x - b * miss_y) / determinant
        back_y += (a * miss_y - c * miss_x) / determinant
    raise ValueError("the deformation cannot be inverted everywhere in the image")


def _metric(gradient: Gradient, radius: float) -> tuple[Image, Image, Image, float]:
    """a, b, c of ``(F F^T)^-1 / r^2``, F = 1 + gradient, and the largest stretch.

    A blob round in the reference has the quadratic form d^T F^-T F^-1 d / r^2 where it has gone.
    """
    xx, xy, yx, yy = gradient
    xx, yy = xx + 1, yy + 1
    scale = 1 / ((xx * yy - xy * yx) * radius) ** 2
    a, b, c = (yx**2 + yy**2) * scale, -(xx * yx + xy * yy) * scale, (xx**2 + xy**2) * scale
    stretch = math.sqrt(float(np.max(xx**2 + xy**2 + yx**2 + yy**2)) / 2)
    return a.astype(np.float32), b.astype(np.float32), c.astype(np.float32), stretch
