"""Fig. 1 of the paper: a ZOI, its windowed spectrum, and the phases that carry its displacement."""

from __future__ import annotations

import numpy as np

from hw_mocks.deformation import Affine
from live.characterise.outcome import Bench, Outcome, Table, figure, save_figure
from live.characterise.spectrum import draw_spectrum, zoi_spectrum
from live.characterise.truth import Camera, Scene

U, V = 0.30, -0.20


def fig1(bench: Bench) -> Outcome:
    """One ZOI of 32x32, 12 bit, no noise, moved by a known shift."""
    scene = Scene((96, 96), 2.0, seed=1)
    before, after = scene.pair(Affine(U, V), Camera(12))
    spectrum = zoi_spectrum(before, after, 32, 32, 32)
    drawn = figure(15, 4)
    draw_spectrum(drawn, spectrum, f"32x32 ZOI, speckle radius 2 px, true displacement u = {U}, v = {V} px")
    name = save_figure(bench, "fig1_phases.png", drawn)
    used = spectrum.used
    columns = ("kx rad/px", "ky rad/px", "amplitude GL", "phase difference rad", "-k.(true displacement) rad")
    rows = zip(
        spectrum.kx[used], spectrum.ky[used], spectrum.amplitude[used], spectrum.phase[used],
        -(spectrum.kx * U + spectrum.ky * V)[used], strict=True,
    )  # fmt: skip
    table = Table("fig1_phases", columns, tuple(tuple(float(value) for value in row) for row in rows))
    misfit = np.array([row[3] - row[4] for row in table.rows])
    weight = np.array([row[2] for row in table.rows]) ** 2
    text = f"""One ZOI of 32x32 px under the bi-triangular window. {len(misfit)} frequencies of a half-plane are used:
those of at least 5 % of the largest amplitude, outside the lobe of zero frequency and up to 0.7 pi rad/px (the
paper only asks for an "amplitude higher than zero"). By eq. (4), with the sign that belongs to its kernel, their
phase differences lie on the plane -k.u. They leave it by {np.sqrt(np.mean(misfit**2)):.3f} rad rms, by
{np.sqrt(np.average(misfit**2, weights=weight)):.3f} rad when weighted with the square of the amplitude: the weak
frequencies carry most of the error, although there is no noise but rounding in this picture. The pseudo-inverse of
eq. (5) gives every frequency the same say and finds u = {spectrum.u:.4f}, v = {spectrum.v:.4f} px for {U} and {V}.
The same picture of any ZOI of a recorded session: `phasedic inspect SESSION --zoi R,C --frame N`.

![A ZOI, its windowed spectrum, the frequencies used and their phases]({name})"""
    return Outcome("fig1", "Fig. 1: the phases of one ZOI", text, (table,), (name,))
