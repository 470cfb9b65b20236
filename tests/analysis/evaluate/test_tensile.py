"""Tensile figures against a curve whose figures are known."""

from __future__ import annotations

import math

import numpy as np
import pytest

from analysis.evaluate.tensile import straight_line, tensile_figures


def curve(E: float, nu: float, yield_stress: float, hardening: float, n: int = 400) -> tuple[np.ndarray, ...]:
    stress = np.linspace(0, 1.6 * yield_stress, n)
    plastic = np.maximum(stress - yield_stress, 0) / hardening
    return stress / E + plastic, -nu * stress / E - 0.5 * plastic, stress


def test_known_curve() -> None:
    axial, transverse, stress = curve(70e9, 0.33, 150e6, 5e9)
    found = tensile_figures(axial, transverse, stress)
    assert pytest.approx(70e9, rel=1e-6) == found.E
    assert found.nu == pytest.approx(0.33, rel=1e-6)
    assert found.Rp02 == pytest.approx(150e6 + 0.002 * 5e9, rel=1e-3)
    assert found.Rm == pytest.approx(240e6)


def test_preload_and_noise() -> None:
    rng = np.random.default_rng(1)
    axial, transverse, stress = curve(70e9, 0.33, 150e6, 5e9)
    axial = axial - axial[40] + rng.normal(0, 5e-6, axial.size)  # the reference was taken under load
    found = tensile_figures(axial, transverse, stress)
    assert abs(found.E - 70e9) < 5 * found.sigma_E + 0.002 * 70e9
    assert found.sigma_E < 0.01 * 70e9


def test_no_plastic_part_and_too_little() -> None:
    strain = np.linspace(0, 1e-3, 50)
    found = tensile_figures(strain, -0.3 * strain, 2e9 * strain)
    assert pytest.approx(2e9, rel=1e-9) == found.E
    assert math.isnan(found.Rp02)
    assert math.isnan(tensile_figures(strain[:3], strain[:3], strain[:3]).E)
    nan = np.full(50, math.nan)
    assert math.isnan(tensile_figures(nan, nan, nan).E)
    assert math.isnan(tensile_figures(strain, strain, -strain - 1).E)


def test_line_uncertainty_is_that_of_repeated_fits() -> None:
    rng = np.random.default_rng(2)
    x = np.linspace(0, 1, 30)
    lines = [straight_line(x, 3 * x + rng.normal(0, 0.1, 30)) for _ in range(600)]
    scatter = np.std([line.slope for line in lines])
    assert np.mean([line.sigma for line in lines]) == pytest.approx(scatter, rel=0.1)
    assert math.isnan(straight_line(np.ones(9), np.ones(9)).slope)
