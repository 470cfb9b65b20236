"""The sigma of a lag: what the noise of the force imitates is no information."""

from __future__ import annotations

import math

import numpy as np
import pytest

from analysis.evaluate.lag import Track, _assessed, _Fit, _Model, _pace_noise

N = 400


def assessed(force_noise: float) -> tuple[_Fit, float, float, float]:
    """A fit over a force with so many N of noise; variance, information, and what noise adds to that."""
    rng = np.random.default_rng(3)
    t = np.linspace(0.0, 8.0, N)
    force = Track(t, 250 * np.maximum(t - 2, 0) ** 1.5 + force_noise * rng.standard_normal(N))
    part = Track(t[20:-20], 1e-6 * force.values[20:-20] + 1e-6 * rng.standard_normal(N - 40))
    model = _Model.at(0.0, part, force, np.zeros(N - 1), 1e-6)
    design, pace = model.shape, model.pace(force)
    q, _ = np.linalg.qr(design)
    free = pace - q @ (q.T @ pace)
    n = float(model.weight @ model.weight)
    spurious = n * (model.found[1] * _pace_noise(force)) ** 2
    return _assessed(model, force, 0.0, 1.0), model.left / (n - 4), float(free @ free), spurious


@pytest.mark.parametrize("force_noise", [1.0, 5.0, 12.0])
def test_sigma_is_of_the_information_that_noise_does_not_imitate(force_noise: float) -> None:
    fit, variance, information, spurious = assessed(force_noise)
    assert fit.sigma == pytest.approx(math.sqrt(variance / (information - spurious)), rel=1e-6)
    assert fit.known == pytest.approx(1 - spurious / information)
    if force_noise > 10:
        assert spurious > 0.05 * information and fit.sigma > 1.02 * math.sqrt(variance / information)


def test_of_noise_alone_nothing_is_known_of_a_lag() -> None:
    rng = np.random.default_rng(3)
    t = np.linspace(0.0, 8.0, N)
    force = Track(t, 10 * rng.standard_normal(N))
    model = _Model.at(0.0, Track(t[20:-20], 1e-6 * force.values[20:-20]), force, np.zeros(N - 1), 1e-6)
    fit = _assessed(model, force, 0.0, 1.0)
    assert fit.known < 0.5 and (math.isinf(fit.sigma) or fit.sigma > 0)
