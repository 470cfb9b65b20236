"""The iteration: warp, take moments of the difference, solve, compose, until the step is small.

One compiled loop over ZOIs; each is done by one thread from start to end, so its numbers depend
neither on the number of threads nor on the other ZOIs.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import prange

from analysis.compiled import helper, inlined, parallel
from analysis.shapes import BLOCK, N_SHAPES, add_shares, bent
from analysis.splines import PAD
from analysis.warp import LANES, inside, warp_row

f4 = np.float32
RUNNING, CONVERGED, LEFT_IMAGE, DIVERGED = 0, 1, 2, 3
GAIN_RANGE = (0.15, 6.0)
"""A step is divided by the estimated gain only within this range."""
LEFT_BY_NOISE = 1.15
"""Share of a step left as error after it, per px of uncertainty from one image (measured: 0.5-1 rms)."""
LEFT_BY_MISFIT = 0.003
"""The same without noise (measured: up to 0.002)."""
LEFT_BY_LENGTH = 0.03
"""The same per px of the step, the next order of the expansion (measured: 0.004-0.03)."""
LONGEST_STEP = 3.0
"""Pixels; a longer step at the edge of the ZOI is shortened to this."""


@inlined
def _moments_of_rows(
    fx: Any, fy: Any, f: Any, raw: Any, at: Any, width: Any, size: int, g: Any, line: Any,
    along_x: Any, bends: Any, w: Any, e: Any,
) -> Any:  # fmt: skip
    """Sums over four rows of w d {f_x, f_y, f, 1} {1, xi, eta}, w d {f_x, f_y} {P2, P3}, and w d^2.

    The difference is d = g - raw, P2 and P3 are polynomials in xi (``shapes``).

    ``at`` is the flat index of the first pixel, ``line`` the distance of rows in ``g``; ``w``
    and ``e`` are the window along y of the four rows and the window times eta.
    """
    w0, w1, w2, w3 = w
    e0, e1, e2, e3 = e
    a0 = f4(0)
    a1 = f4(0)
    a2 = f4(0)
    b0 = f4(0)
    b1 = f4(0)
    b2 = f4(0)
    c0 = f4(0)
    c1 = f4(0)
    c2 = f4(0)
    d0 = f4(0)
    d1 = f4(0)
    d2 = f4(0)
    a3 = f4(0)
    a4 = f4(0)
    b3 = f4(0)
    b4 = f4(0)
    energy = f4(0)
    i1 = at + width
    i2 = i1 + width
    i3 = i2 + width
    l2 = line + line
    l3 = l2 + line
    for n in range(size):
        k = np.uintp(n)
        p = g[k] - raw[at + k]
        q = g[line + k] - raw[i1 + k]
        r = g[l2 + k] - raw[i2 + k]
        s = g[l3 + k] - raw[i3 + k]
        wp = w0 * p
        wq = w1 * q
        wr = w2 * r
        ws = w3 * s
        x0 = along_x[0, k]
        x1 = along_x[1, k]
        energy += x0 * (wp * p + wq * q + wr * r + ws * s)
        ep = e0 * p
        eq = e1 * q
        er = e2 * r
        es = e3 * s
        t = wp * fx[at + k] + wq * fx[i1 + k] + wr * fx[i2 + k] + ws * fx[i3 + k]
        a0 += x0 * t
        a1 += x1 * t
        a3 += bends[0, k] * t
        a4 += bends[1, k] * t
        a2 += x0 * (ep * fx[at + k] + eq * fx[i1 + k] + er * fx[i2 + k] + es * fx[i3 + k])
        t = wp * fy[at + k] + wq * fy[i1 + k] + wr * fy[i2 + k] + ws * fy[i3 + k]
        b0 += x0 * t
        b1 += x1 * t
        b3 += bends[0, k] * t
        b4 += bends[1, k] * t
        b2 += x0 * (ep * fy[at + k] + eq * fy[i1 + k] + er * fy[i2 + k] + es * fy[i3 + k])
        t = wp * f[at + k] + wq * f[i1 + k] + wr * f[i2 + k] + ws * f[i3 + k]
        c0 += x0 * t
        c1 += x1 * t
        c2 += x0 * (ep * f[at + k] + eq * f[i1 + k] + er * f[i2 + k] + es * f[i3 + k])
        t = wp + wq + wr + ws
        d0 += x0 * t
        d1 += x1 * t
        d2 += x0 * (ep + eq + er + es)
    return a0, a1, a2, b0, b1, b2, c0, c1, c2, d0, d1, d2, energy, a3, a4, b3, b4


@helper
def _second_moments_of_rows(
    fx: Any, fy: Any, raw: Any, at: Any, width: Any, size: int, g: Any, line: Any,
    along_x: Any, w: Any, e: Any, h: Any,
) -> Any:  # fmt: skip
    """Sums over four rows of w d {f_x, f_y} {xi^2, xi eta, eta^2}; ``h`` is the window times eta^2."""
    a0 = f4(0)
    a1 = f4(0)
    a2 = f4(0)
    b0 = f4(0)
    b1 = f4(0)
    b2 = f4(0)
    for row in range(BLOCK):
        j = np.uintp(row)
        first = at + j * width
        wy = w[row]
        ey = e[row]
        hy = h[row]
        for n in range(size):
            k = np.uintp(n)
            d = g[j * line + k] - raw[first + k]
            dx = d * fx[first + k]
            dy = d * fy[first + k]
            x0 = along_x[0, k] * hy
            x1 = along_x[1, k] * ey
            x2 = along_x[2, k] * wy
            a0 += x2 * dx
            a1 += x1 * dx
            a2 += x0 * dx
            b0 += x2 * dy
            b1 += x1 * dy
            b2 += x0 * dy
    return a0, a1, a2, b0, b1, b2


@helper
def _add_rows(order: int, m: Any, s: Any) -> None:
    """Add the first moments of some rows to J' w d (order of ``sensitivity.columns``)."""
    half = 3 if order == 1 else 6
    for i in range(3):
        m[i] += s[i]
        m[half + i] += s[3 + i]
        m[2 * half + i] += s[6 + i]
        m[2 * half + 3 + i] += s[9 + i]


@helper
def _within_image(
    p: Any, order: int, cx: Any, cy: Any, reach: Any, width: int, height: int, over: Any
) -> bool:
    """Whether the corners of the warped ZOI stay in the image, or at most ``over`` px beyond it."""
    for corner in range(4):
        x = reach if corner & 1 else -reach
        y = reach if corner & 2 else -reach
        u, v = displacement(p, order, x, y)
        if not inside(cx + x + u, cy + y + v, -over, width - 1 + over, -over, height - 1 + over):
            return False
    return True


@helper
def displacement(p: Any, order: int, x: Any, y: Any) -> Any:
    """(u, v) in px at (x, y) px from the centre."""
    if order == 1:
        return p[0] + p[1] * x + p[2] * y, p[3] + p[4] * x + p[5] * y
    u = p[0] + p[1] * x + p[2] * y + p[3] * x * x + p[4] * x * y + p[5] * y * y
    v = p[6] + p[7] * x + p[8] * y + p[9] * x * x + p[10] * x * y + p[11] * y * y
    return u, v


@helper
def compose(p: Any, order: int, d: Any) -> None:
    """W := W o (identity + d)^-1, in place; exact for order 1, to second order in x for order 2."""
    half = 3 if order == 1 else 6
    a = 1 + d[1]
    b = d[2]
    c = d[half + 1]
    e = 1 + d[half + 2]
    det = a * e - b * c
    ia, ib, ic, ie = e / det, -b / det, -c / det, a / det
    # x = M (y - t) of the inverse step; for order 2 less M times its quadratic part at M (y - t).
    tx = -(ia * d[0] + ib * d[half])
    ty = -(ic * d[0] + ie * d[half])
    if order == 1:
        for r in range(0, 6, 3):
            ux, uy = p[r + 1] + (r == 0), p[r + 2] + (r == 3)
            p[r] += ux * tx + uy * ty
            p[r + 1] = ux * ia + uy * ic - (r == 0)
            p[r + 2] = ux * ib + uy * ie - (r == 3)
        return
    # The inverse step as a quadratic polynomial: X = tx + ia x + ib y + q . (x^2, xy, y^2), Y likewise.
    qx = np.empty(3)
    qy = np.empty(3)
    for k in range(3):
        qx[k] = -(ia * d[3 + k] + ib * d[9 + k])
        qy[k] = -(ic * d[3 + k] + ie * d[9 + k])
    for r in range(0, 12, 6):
        p0, ux, uy = p[r], p[r + 1] + (r == 0), p[r + 2] + (r == 6)
        xx, xy, yy = p[r + 3], p[r + 4], p[r + 5]
        p[r] = p0 + ux * tx + uy * ty + xx * tx * tx + xy * tx * ty + yy * ty * ty
        gx = ux + 2 * xx * tx + xy * ty
        gy = uy + 2 * yy * ty + xy * tx
        p[r + 1] = gx * ia + gy * ic - (r == 0)
        p[r + 2] = gx * ib + gy * ie - (r == 6)
        p[r + 3] = gx * qx[0] + gy * qy[0] + xx * ia * ia + xy * ia * ic + yy * ic * ic
        p[r + 4] = gx * qx[1] + gy * qy[1] + 2 * xx * ia * ib + xy * (ia * ie + ib * ic) + 2 * yy * ic * ie
        p[r + 5] = gx * qx[2] + gy * qy[2] + xx * ib * ib + xy * ib * ie + yy * ie * ie


@inlined
def warp_zoi_row(
    c: Any, stride: int, p: Any, order: int, cx: Any, cy: Any, reach: Any, y: Any,
    size: int, ramp: Any, table: Any, out: Any, at: int,
) -> None:  # fmt: skip
    """Row at ``y`` px from the centre of a ZOI centred at (cx, cy) px of the image."""
    u, v = displacement(p, order, -reach, y)
    if order == 1:
        x1, x2, y1, y2 = 1 + p[1], 0.0, p[4], 0.0
    else:
        x1, x2 = 1 + p[1] + p[4] * y - 2 * p[3] * reach, p[3]
        y1, y2 = p[7] + p[10] * y - 2 * p[9] * reach, p[9]
    warp_row(c, stride, size, ramp, cx - reach + u + PAD, x1, x2, cy + y + v + PAD, y1, y2, table, out, at)


@helper
def _moments(
    c: Any, width: int, fx: Any, fy: Any, f: Any, raw: Any, top: int, first: int, size: int, order: int,
    along_x: Any, bends: Any, blocks: Any, slope: Any, q: Any, ramp: Any, table: Any, g: Any, m: Any, shares: Any,
) -> Any:  # fmt: skip
    """Warp one ZOI and write J' w d to ``m`` and the sums with the shapes to ``shares``; returns d' w d."""
    stride = width + 2 * PAD
    reach = (size - 1) / 2
    rounded = (size + LANES - 1) // LANES * LANES
    line = size + LANES
    m[:] = 0
    shares[:] = 0
    energy = 0.0
    for y in range(0, size, BLOCK):
        for j in range(min(BLOCK, size - y)):
            warp_zoi_row(
                c, stride, q, order, first + reach, top + reach, reach, y + j - reach,
                size, ramp, table, g, j * line,
            )  # fmt: skip
        # Rows beyond the ZOI have weight zero.
        at = np.uintp((top + y) * width + first)
        w = (along_x[0, y], along_x[0, y + 1], along_x[0, y + 2], along_x[0, y + 3])
        e = (along_x[1, y], along_x[1, y + 1], along_x[1, y + 2], along_x[1, y + 3])
        s = _moments_of_rows(
            fx, fy, f, raw, at, np.uintp(width), rounded, g, np.uintp(line), along_x, bends, w, e
        )  # fmt: skip
        _add_rows(order, m, s)
        energy += s[12]
        n = y // BLOCK
        p = (blocks[0, n], blocks[1, n], blocks[2, n], blocks[3, n])
        add_shares(shares, 0, (s[0], s[1], s[13], s[14]), p, slope)
        add_shares(shares, N_SHAPES, (s[3], s[4], s[15], s[16]), p, slope)
        if order == 2:
            h = (along_x[2, y], along_x[2, y + 1], along_x[2, y + 2], along_x[2, y + 3])
            t = _second_moments_of_rows(
                fx, fy, raw, at, np.uintp(width), rounded, g, np.uintp(line), along_x, w, e, h
            )  # fmt: skip
            for i in range(3):
                m[3 + i] += t[i]
                m[9 + i] += t[3 + i]
    return energy


@helper
def _solve(inverse: Any, m: Any, step: Any, energy: Any) -> Any:
    """Parameters of one linear fit and the weighted sum of squares it leaves."""
    left = energy
    for i in range(len(m)):
        total = 0.0
        for j in range(len(m)):
            total += inverse[i, j] * m[j]
        step[i] = total
        left -= total * m[i]
    return left


@parallel
def track(
    c: Any, width: int, height: int, fx: Any, fy: Any, f: Any, raw: Any, origins: Any, size: int,
    order: int, along_x: Any, bends: Any, blocks: Any, slope: Any, inverse: Any, cross: Any, squares: Any,
    units: Any, tolerance: Any, trust: Any, table: Any, over: Any,
    max_iterations: int, p: Any, left: Any, bending: Any, nuisance: Any, state: Any, iterations: Any,
) -> None:  # fmt: skip
    """Measure all ZOIs.

    Parameters
    ----------
    c : flat (H + 2 PAD) * (W + 2 PAD) float32
        Spline coefficients of the deformed image (``warp.coefficients``).
    fx, fy, f, raw : flat float32
        Filtered reference and the reference as it was recorded, LANES samples longer than the image.
    origins : (A, 2) int64, first row and column of each ZOI
    along_x : (2 order + 1, size + LANES) float32
        Window times powers of xi; zero beyond ``size``.
    bends, blocks, slope : see ``shapes.Shapes``: rows, blocks and mix[1, 1]
    inverse : (A, P, P) float32
    cross : (A, 10, P) float32
    squares : (A, 2) float64
        Sums of w f_x^2 and w f_y^2.
    tolerance : (A, 2) float64
        Error that may be left in u and v (px) and in the gradients.
    trust : (A,) float64, px
        Predicted uncertainty of u and v from the noise of the deformed image.
    p : (A, 6 or 12) float64, px units, start values in, result out
    left : (A,) float64, out: weighted sum of squared differences after the fit, GL^2
    bending : (A,) float64, out: what the fit leaves of a displacement that bends or jumps, px^2 (``shapes.bent``)
    nuisance : (A, 2) float64, out: gain, and offset in GL
    state, iterations : (A,) uint8, out
    """
    count = inverse.shape[1]
    modes = p.shape[1]
    half = modes // 2
    reach = (size - 1) / 2
    lever = size / 6.0
    chunks = (len(origins) + 31) // 32
    for chunk in prange(chunks):
        g = np.zeros(BLOCK * (size + LANES) + LANES, np.float32)
        ramp = np.arange(size + LANES).astype(np.float32)
        m = np.empty(count)
        step = np.empty(count)
        shares = np.empty(2 * N_SHAPES)
        for z in range(chunk * 32, min(chunk * 32 + 32, len(origins))):
            top, first = origins[z]
            q = p[z]
            state[z] = RUNNING
            for iteration in range(max_iterations):
                if not _within_image(q, order, first + reach, top + reach, reach, width, height, over):
                    state[z] = LEFT_IMAGE
                    break
                energy = _moments(
                    c, width, fx, fy, f, raw, top, first, size, order, along_x, bends, blocks, slope,
                    q, ramp, table, g, m, shares,
                )  # fmt: skip
                left[z] = _solve(inverse[z], m, step, energy)
                gain = 1 + step[modes]
                nuisance[z, 0] = gain
                nuisance[z, 1] = step[modes + 3]
                gain = min(max(gain, GAIN_RANGE[0]), GAIN_RANGE[1])
                bending[z] = bent(shares, cross[z], step, squares[z, 0], squares[z, 1]) / gain**2
                longest = 0.0
                for i in range(modes):
                    longest = max(longest, abs(step[i]) / gain)
                if not longest < 1e3:
                    state[z] = DIVERGED
                    break
                brake = min(1.0, LONGEST_STEP / longest) if longest > 0 else 1.0
                for i in range(modes):
                    step[i] *= units[i] / gain * brake
                compose(q, order, step)
                iterations[z] = iteration + 1
                if brake == 1.0 and _settled(step, half, lever, tolerance[z], trust[z]):
                    state[z] = CONVERGED
                    break


@helper
def _settled(step: Any, half: int, lever: Any, tolerance: Any, trust: Any) -> Any:
    """Whether the error that this step has left is below the tolerances of u, v and the gradients."""
    move = max(abs(step[0]), abs(step[half]))
    turn = 0.0
    for i in range(1, 3):
        turn = max(turn, abs(step[i]), abs(step[half + i]))
    length = max(move, turn * lever)
    left = length * (LEFT_BY_MISFIT + LEFT_BY_NOISE * trust + LEFT_BY_LENGTH * length)
    return left <= tolerance[0] and left <= tolerance[1] * lever


@parallel
def warp_zois(c: Any, width: int, origins: Any, size: int, p: Any, table: Any, out: Any) -> None:
    """The deformed image in every warped ZOI of order 1, (A, n, n) float32, written to ``out``."""
    stride = width + 2 * PAD
    reach = (size - 1) / 2
    for z in prange(len(origins)):
        row = np.empty(size + LANES, np.float32)
        ramp = np.arange(size + LANES).astype(np.float32)
        for y in range(size):
            warp_zoi_row(
                c, stride, p[z], 1, origins[z, 1] + reach, origins[z, 0] + reach, reach, y - reach,
                size, ramp, table, row, 0,
            )  # fmt: skip
            out[z, y] = row[:size]


@helper
def compose_all(p: Any, steps: Any) -> None:
    """``compose`` for every ZOI of order 1, in place."""
    for z in range(len(p)):
        compose(p[z], 1, steps[z])


@helper
def within_image(p: Any, origins: Any, size: int, width: int, height: int, over: Any, out: Any) -> None:
    """Whether each warped ZOI of order 1 lies in the image, written to ``out`` (A,) bool."""
    reach = (size - 1) / 2
    for z in range(len(p)):
        out[z] = _within_image(
            p[z], 1, origins[z, 1] + reach, origins[z, 0] + reach, reach, width, height, over
        )  # fmt: skip
