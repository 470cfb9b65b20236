"""The self-test: a healthy machine passes it with all settings, and a broken one measures nothing."""

from __future__ import annotations

import itertools
import subprocess
import sys
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np
import pytest
import scipy.fft

from analysis import KernelSettings, MachineError, PhaseKernel, Roi, ZoiGrid, self_test, warm_up
from analysis.field import WINDOWS
from analysis.fit import sensitivity
from analysis.kernel import solve
from analysis.kernel.phase_kernel import _measure_known as measure_known
from analysis.kernel.phase_kernel import check_machine
from analysis.picture import spectrum, splines
from analysis.self_test import SelfTestCase, errors_of, limits, measuring_fault, picture

GRID = ZoiGrid.cover(Roi(8, 8, 80, 80), size=32, step=16)
IMAGE = picture(96, self_test.STILL)
WAYS = [("spectral", 1), ("spectral", 2), ("phase", 1)]


@pytest.fixture
def untested() -> Iterator[None]:
    """As in a process that has measured nothing yet; the same again afterwards."""
    for remembered in (self_test._check_algebra, self_test._check_measuring):
        remembered.cache_clear()
    yield
    for remembered in (self_test._check_algebra, self_test._check_measuring):
        remembered.cache_clear()


def spoilt(function: Callable[..., Any], factor: float) -> Callable[..., Any]:
    """The function with an error of a share of each value, up and down in turn."""

    def wrong(*arguments: Any, **named: Any) -> Any:
        found = function(*arguments, **named)
        value = np.asarray(found)
        return (value * (1 + factor * (-1.0) ** np.arange(value.size)).reshape(value.shape)).astype(
            value.dtype
        )

    return wrong


@pytest.mark.parametrize("size", [3, 8, 12, 16, 20, 31, 32, 48, 64, 96, 128, 1024])
@pytest.mark.parametrize(("estimator", "order"), WAYS)
def test_a_healthy_machine_passes(estimator: Any, order: int, size: int) -> None:
    """With a margin: at most two thirds of any limit, a tenth of those of the degree that tests use."""
    for window, degree in itertools.product(WINDOWS, (1, 3, 5)):
        case = SelfTestCase(window, estimator, order, degree, size).tested
        found, allowed = errors_of(measure_known, case), limits(case)
        margin = 10 if degree == 5 else 1.5
        assert found.length < allowed.length / margin and found.slope < allowed.slope / margin, (case, found)
        assert found.gradient < allowed.gradient / 4 and found.noise < allowed.noise / 1.5, (case, found)


def test_the_pattern_has_its_motion() -> None:
    """Against the sum of cosines, pixel by pixel, at the place that moved there."""
    side, m = 24, self_test.MOVED
    found = picture(side, m)
    motion = np.array([[1 + m.du_dx, m.du_dy], [m.dv_dx, 1 + m.dv_dy]])
    n = np.arange(self_test.WAVES)
    k = 2 * np.pi * np.linspace(self_test.MIN_FREQUENCY, self_test.MAX_FREQUENCY, 2 * len(n) + 1)[1::2]
    for row, column in [(0, 0), (3, 20), (23, 11)]:
        here = np.array([column, row]) - (side - 1) / 2
        x, y = np.linalg.solve(motion, here - [m.u, m.v])
        waves = np.cos(
            k * np.cos(self_test.GOLDEN * n) * x + k * np.sin(self_test.GOLDEN * n) * y + 1.7 * n**2
        )
        expected = self_test.LEVEL_GL + self_test.CONTRAST_GL * np.sqrt(2 / len(n)) * waves.sum()
        assert found[row, column] == pytest.approx(expected, abs=1e-2)


@pytest.mark.parametrize("factor", [0.02, 0.1, -0.5])
@pytest.mark.parametrize("size", [16, 32, 64])
@pytest.mark.parametrize(("estimator", "order"), WAYS)
def test_wrong_taps_are_found(
    untested: None, monkeypatch: pytest.MonkeyPatch, estimator: Any, order: int, size: int, factor: float
) -> None:
    monkeypatch.setattr(solve, "tap_table", spoilt(solve.tap_table, factor))
    with pytest.raises(MachineError, match=rf"ZOIs of {size} px: "):
        check_machine(KernelSettings(estimator=estimator, order=order), size)


def scaled(function: Callable[..., Any], factor: float) -> Callable[..., Any]:
    return lambda *arguments, **named: function(*arguments, **named) * np.float32(factor)


def one_pole_off(degree: int, *, which: int, factor: float) -> Any:
    poles = splines.prefilter_poles(degree).copy()
    poles[which] *= factor
    return poles


SUMS: dict[str, list[tuple[Any, str]]] = {
    "spectral": [(sensitivity, "square_rows"), (sensitivity, "parameter_scale")], "phase": [(np, "einsum")],
}  # fmt: skip
"""What the covariance of a ZOI is summed with, beside its pixels."""


@pytest.mark.parametrize("size", [16, 32, 64])
@pytest.mark.parametrize(("estimator", "order"), WAYS)
def test_what_makes_sigma_wrong_is_found(
    untested: None, monkeypatch: pytest.MonkeyPatch, estimator: Any, order: int, size: int
) -> None:
    """A gradient that is 10 % too large makes sigma 9 % too small, and moves no displacement."""
    settings = KernelSettings(estimator=estimator, order=order)
    faults: list[tuple[Any, str, Any]] = [
        (splines, "gradient_filter", scaled(splines.gradient_filter, 1.1)),
        (splines, "gradient_filter", scaled(splines.gradient_filter, 0.99)),
        *((module, name, scaled(getattr(module, name), 1.03)) for module, name in SUMS[estimator]),
        (solve, "prefilter_poles", partial(one_pole_off, which=1, factor=1.02)),
        (solve, "prefilter_poles", partial(one_pole_off, which=2, factor=1.2)),
        *((scipy.fft, name, scaled(getattr(scipy.fft, name), 1.02)) for name in ("rfft", "irfft")),
    ]
    for module, name, wrong in faults:
        with monkeypatch.context() as patched:
            patched.setattr(module, name, wrong)
            _forget()
            with pytest.raises(MachineError, match="what sigma is made of"):
                check_machine(settings, size)
    _forget()
    check_machine(settings, size)


def _forget() -> None:
    """A process starts with neither: what it has once made is kept."""
    self_test._check_measuring.cache_clear()
    spectrum._gradient_response.cache_clear()


def test_a_kernel_is_refused_with_the_names_of_the_libraries(
    untested: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(solve, "tap_table", spoilt(solve.tap_table, 0.1))
    for _ in range(2):  # a failure is never remembered as a success
        with pytest.raises(MachineError) as caught:
            PhaseKernel(IMAGE, GRID)
    message = str(caught.value)
    blas = np.show_config(mode="dicts")["Build Dependencies"]["blas"]  # type: ignore[index,call-overload]
    assert "nothing is measured" in message
    assert f"numpy {np.__version__} (BLAS and LAPACK: {blas['name']} {blas['version']}" in message
    assert "scipy 1." in message and "numba 0." in message
    monkeypatch.undo()
    assert PhaseKernel(IMAGE, GRID).measure(IMAGE).ok.all()


def test_warming_up_is_refused(untested: None, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(solve, "tap_table", spoilt(solve.tap_table, 0.1))
    with pytest.raises(MachineError):
        warm_up(phase=False)


@pytest.mark.parametrize(
    ("module", "name"),
    [
        (np.linalg, "solve"),
        (np.linalg, "inv"),
        (np.polynomial.polynomial, "polyfit"),
        (np, "polyfit"),
    ],
)
def test_a_broken_linear_algebra_is_named(
    untested: None, monkeypatch: pytest.MonkeyPatch, module: Any, name: str
) -> None:
    monkeypatch.setattr(module, name, spoilt(getattr(module, name), 1e-3))
    with pytest.raises(
        MachineError, match=rf"{name} gives a wrong result on this machine; nothing is measured"
    ):
        PhaseKernel(IMAGE, GRID)


@pytest.mark.parametrize("name", ["lstsq", "svd"])
def test_broken_decompositions_are_named(untested: None, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    whole = getattr(np.linalg, name)

    def wrong(*arguments: Any, **named: Any) -> Any:
        first, *rest = whole(*arguments, **named)
        return spoilt(lambda: first, 1e-3)(), *rest

    monkeypatch.setattr(np.linalg, name, wrong)
    with pytest.raises(MachineError, match=f"np.linalg.{name} gives a wrong result"):
        PhaseKernel(IMAGE, GRID)


def test_one_that_gives_up_is_named(untested: None, monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(*arguments: Any, **named: Any) -> Any:
        raise np.linalg.LinAlgError("SVD did not converge")

    monkeypatch.setattr(np.linalg, "svd", fails)
    with pytest.raises(MachineError, match=r"np\.linalg\.svd \(SVD did not converge\)"):
        PhaseKernel(IMAGE, GRID)


@pytest.mark.parametrize("value", [np.nan, np.inf, 0.0])
def test_taps_without_a_value(monkeypatch: pytest.MonkeyPatch, value: float) -> None:
    """Whatever comes of it, it is no traceback and no pass."""
    monkeypatch.setattr(solve, "tap_table", lambda degree: np.full(18, value, np.float32))
    for estimator, order in WAYS:
        assert measuring_fault(measure_known, SelfTestCase("gaussian", estimator, order, 5, 32))


def test_what_passed_is_not_tested_again(untested: None, monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[SelfTestCase] = []

    def counted(measure: self_test.Measure, case: SelfTestCase) -> self_test.Errors:
        seen.append(case)
        return errors_of(measure, case)

    monkeypatch.setattr(self_test, "errors_of", counted)
    for bending in (0.05, np.inf):  # no part of what is tested
        PhaseKernel(IMAGE, GRID, KernelSettings(bending_px=bending))
    PhaseKernel(IMAGE, GRID, KernelSettings(order=2))
    assert seen == [SelfTestCase("gaussian", "spectral", order, 5, 32) for order in (1, 2)]


def test_the_process_that_compiles_the_rest_leaves_the_iteration_alone() -> None:
    """Else both processes would compile what takes longest."""
    code = (
        "from analysis import warm_up\n"
        "from analysis.fit.iteration import track\n"
        "warm_up('rest', ['float32'])\n"
        "assert not track.dispatcher.signatures\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
