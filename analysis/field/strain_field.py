"""The result of one measurement: displacement, gradients, their uncertainty and a status, per ZOI.

Strains, rotation and principal values are derived here from the displacement gradient
(docs/method.md); nothing is smoothed. x points right and y down on the screen, so a positive
``omega`` is clockwise. Named values are attributes: ``field.exx`` is
``field.value("exx")``, ``sigma_exx`` its sigma.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, Protocol, Self, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis.field import uncertainty
from analysis.field.grid import Motion, Status, Window, ZoiGrid


class NamedValues(Protocol):
    """A result with values by their names."""

    def value(self, name: str, /) -> uncertainty.Floats: ...

    def sigma(self, name: str, /) -> uncertainty.Floats: ...


class Value:
    """An attribute that is the value of its own name, (R, C); ``text`` describes it with its unit."""

    def __init__(self, text: str) -> None:
        self.__doc__ = text

    def __set_name__(self, owner: type, name: str) -> None:
        uncertainty.combination(name)  # a name that is not known is refused here
        self.name = name

    @overload
    def __get__(self, field: None, owner: type) -> Self: ...

    @overload
    def __get__(self, field: NamedValues, owner: type) -> uncertainty.Floats: ...

    def __get__(self, field: NamedValues | None, owner: type) -> Self | uncertainty.Floats:
        return self if field is None else self.of(field)

    def of(self, field: NamedValues) -> uncertainty.Floats:
        return field.value(self.name)


class Sigma(Value):
    """An attribute ``sigma_NAME`` that is the standard uncertainty of the value NAME, (R, C), in its unit."""

    def __init__(self) -> None:
        super().__init__("Standard uncertainty of the value of this name, (R, C), in its unit.")

    def __set_name__(self, owner: type, name: str) -> None:
        super().__set_name__(owner, name.removeprefix("sigma_"))

    def of(self, field: NamedValues) -> uncertainty.Floats:
        return field.sigma(self.name)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class StrainField:
    """One measured field on the grid of the reference; NaN where the status is not OK.

    Attributes
    ----------
    grid : ZoiGrid
    parameters : (6, R, C) or (12, R, C) float64
        u, du_dx, du_dy (and, order 2, the coefficients of x^2, xy, y^2), then the same of v; at
        the centres of the ZOIs, px and px per px.
    covariance : (21, R, C) float32
        Of the six affine values, pairs (i, j >= i) in order; includes the reference's part.
    covariance_reference : (21, R, C) float32
        The part of it that the noise of the reference causes, common to all frames.
    residual : (R, C) float32
        Variance of what the fit leaves over the variance expected from the noise; about 1.
    status : (R, C) uint8, see Status
    iterations : (R, C) uint8
    gain : (R, C) float32
        Contrast of the deformed image over that of the reference.
    noise : float, GL
        Standard deviation of the deformed image that the uncertainty was computed with.
    window : str
        The least-squares weight, from which the correlation of neighbouring values follows.
    motion : Motion, optional
        For the start in the next frame.
    measure : "small", "engineering", "green" or "hencky"
        What ``exx``, ``eyy``, ``exy`` and their means are; the uncertainties are those of the small strains.
    sums : Sums, optional
        Makes the uncertainty of means right where neighbours nearly cancel (gradients on dense grids).
    common : CommonError, optional
        Of a correction that all ZOIs have; in the uncertainties, not in ``covariance``.
    picture : PictureError, optional
        What the picture leaves beyond its noise; it is part of the uncertainties.
    blur : (2, R, C) float32, px^2, optional
        Growth of the variance of the blur since the last reference, mean of x and y, negative where the picture
        is sharper; and its standard uncertainty.
    parts : (R, C) uint8, optional
        Where the field has come apart: numbers of its parts from 1, 0 of ZOIs in none; None: it has not.
    """

    grid: ZoiGrid
    parameters: uncertainty.Floats
    covariance: NDArray[np.float32]
    covariance_reference: NDArray[np.float32]
    residual: NDArray[np.float32]
    status: NDArray[np.uint8]
    iterations: NDArray[np.uint8]
    gain: NDArray[np.float32]
    noise: float = float("nan")
    window: Window = "gaussian"
    motion: Motion | None = None
    measure: uncertainty.Measure = "small"
    sums: uncertainty.Sums | None = None
    common: uncertainty.CommonError | None = None
    picture: uncertainty.PictureError | None = None
    blur: NDArray[np.float32] | None = None
    parts: NDArray[np.uint8] | None = None

    def __post_init__(self) -> None:
        for name in ("parameters", "covariance", "covariance_reference", "residual", "status",
                     "iterations", "gain", "blur", "parts"):  # fmt: skip
            array = getattr(self, name)
            if array is not None:
                array.flags.writeable = False

    def __repr__(self) -> str:
        rows, columns = self.grid.shape
        words = f"{self.n_valid} of {self.grid.n_active} with a value"
        refused = ", ".join(f"{n} {status.name}" for status, n in self.refused.items())
        means = ", ".join(f"{name} {self.mean(name)[0]:+.3g}" for name in ("exx", "eyy", "exy"))
        refused = f" ({refused})" if refused else ""
        return f"<StrainField {rows} x {columns} ZOIs, {words}{refused}; mean {means} ({self.measure})>"

    @classmethod
    def from_values(
        cls,
        grid: ZoiGrid,
        values: Mapping[str, ArrayLike],
        sigmas: Mapping[str, ArrayLike] | float = 0.0,
        status: ArrayLike | None = None,
        residual: ArrayLike = 1.0,
    ) -> StrainField:
        """A field from plain arrays, as they are read from a file or imposed by a test.

        Parameters
        ----------
        grid : ZoiGrid
        values : mapping of "u", "v", "du_dx", "du_dy", "dv_dx", "dv_dy" to (R, C); 0 where missing
        sigmas : mapping of the same names to (R, C), or one number for all
        status : (R, C), optional
            OK where the grid is active and NOT_MEASURED elsewhere, if not given.
        residual : (R, C)
        """
        names = ("u", "du_dx", "du_dy", "v", "dv_dx", "dv_dy")
        parameters = np.stack([_filled(values.get(n, 0.0), grid) for n in names])
        covariance = np.zeros((21, *grid.shape), np.float32)
        for i, name in enumerate(names):
            sigma = sigmas.get(name, 0.0) if isinstance(sigmas, Mapping) else sigmas
            covariance[uncertainty.PAIR_INDEX[i, i]] = _filled(sigma, grid) ** 2
        if status is None:
            status = np.where(grid.active, Status.OK, Status.NOT_MEASURED)
        states = np.array(status, np.uint8)
        parameters[:, states != Status.OK] = np.nan
        covariance[:, states != Status.OK] = np.nan
        return cls(
            grid, parameters, covariance, np.zeros_like(covariance),
            _filled(residual, grid).astype(np.float32), states,
            np.zeros(grid.shape, np.uint8), np.ones(grid.shape, np.float32),
        )  # fmt: skip

    u = Value("Displacement along x (right), (R, C), px.")
    v = Value("Displacement along y (down), (R, C), px.")
    du_dx = Value("Change of u along x, (R, C).")
    du_dy = Value("Change of u along y, (R, C).")
    dv_dx = Value("Change of v along x, (R, C).")
    dv_dy = Value("Change of v along y, (R, C).")
    exx = Value("Small strain along x, (R, C).")
    eyy = Value("Small strain along y, (R, C).")
    exy = Value("Small shear strain, tensor component, (R, C).")
    gamma_xy = Value("Engineering shear, 2 exy, (R, C).")
    omega = Value("Small rotation (dv_dx - du_dy)/2, (R, C), rad, positive clockwise on the screen.")
    sigma_u = Sigma()
    sigma_v = Sigma()
    sigma_du_dx = Sigma()
    sigma_du_dy = Sigma()
    sigma_dv_dx = Sigma()
    sigma_dv_dy = Sigma()
    sigma_exx = Sigma()
    sigma_eyy = Sigma()
    sigma_exy = Sigma()
    sigma_gamma_xy = Sigma()
    sigma_omega = Sigma()

    @property
    def ok(self) -> NDArray[np.bool_]:
        """ZOIs with a valid value, (R, C)."""
        return np.asarray(self.status == Status.OK)

    @property
    def refused(self) -> dict[Status, int]:
        """How many ZOIs have no value for each reason, the commonest first; NOT_MEASURED is left out."""
        found, counts = np.unique(self.status, return_counts=True)
        tally = {Status(int(s)): int(n) for s, n in zip(found, counts, strict=True)}
        refused = {s: n for s, n in tally.items() if s not in (Status.OK, Status.NOT_MEASURED)}
        return dict(sorted(refused.items(), key=lambda item: -item[1]))

    @property
    def n_valid(self) -> int:
        """Number of ZOIs with a valid value."""
        return int(np.count_nonzero(self.ok))

    def n_parts(self, where: NDArray[np.bool_] | None = None) -> int:
        """Parts that have come apart among the ZOIs ``where`` (R, C), by default all; 1 where none have."""
        if self.parts is None:
            return 1
        parts = self.parts if where is None else self.parts[where]
        return max(len(np.unique(parts[parts > 0])), 1)

    def value(self, name: str) -> uncertainty.Floats:
        """A value by its name (see ``VALUES``), (R, C); read-only where it is one of the parameters.

        Raises
        ------
        ValueError
            Unknown name.
        """
        if self.measure != "small" and name in ("exx", "eyy", "exy", "gamma_xy"):
            strain = self.strain(self.measure)
            return 2 * strain.exy if name == "gamma_xy" else np.asarray(getattr(strain, name))
        half = len(self.parameters) // 2
        terms = [
            (c, self.parameters[i % 3 + half * (i // 3)]) for i, c in uncertainty.combination(name).items()
        ]
        if len(terms) == 1 and terms[0][0] == 1:
            return np.asarray(terms[0][1])
        return np.asarray(sum(c * values for c, values in terms))

    def sigma(self, name: str, part: Literal["all", "reference", "current"] = "all") -> uncertainty.Floats:
        """Standard uncertainty of a value, (R, C), in its unit.

        ``part`` separates what the noise of the reference causes, which is common to all
        frames measured against it, from what the noise of the deformed image causes.
        """
        if part == "current":
            variance = self._variance(name, self.covariance) - self._variance(name, self.covariance_reference)
        else:
            variance = self._variance(name, self.covariance if part == "all" else self.covariance_reference)
        if self.common is not None and part != "reference":
            variance += self.common.variance(name)
        return np.asarray(np.sqrt(np.maximum(variance, 0, out=variance), out=variance))

    def own_share(self, name: str) -> float:
        """Share of the variance of a value that is not of the reference, of a typical ZOI; 1 where none is known."""
        sigma = self.sigma(name)
        known = self.ok & (sigma > 0)
        shares = (self.sigma(name, "current")[known] / sigma[known]) ** 2
        return float(np.median(shares)) if shares.size else 1.0

    def _variance(self, name: str, covariance: NDArray[np.float32]) -> uncertainty.Floats:
        (first, factor), *others = uncertainty.products(name)
        out: uncertainty.Floats = covariance[first].astype(np.float64)
        if factor != 1:
            out *= factor
        for pair, factor in others:
            out += factor * covariance[pair].astype(np.float64)
        return out

    def mean(self, name: str, where: ArrayLike | None = None) -> tuple[float, float]:
        """Mean of a value over the valid ZOIs and the standard uncertainty of that mean.

        Overlapping ZOIs have noise in common; their correlation, known from the window, is
        taken into account. (NaN, NaN) where no ZOI is valid.

        Parameters
        ----------
        name : str
            One of ``VALUES``.
        where : (R, C) bool, optional
            Only these ZOIs, a gauge.
        """
        chosen = self.ok if where is None else self.ok & np.asarray(where, bool)
        count = int(np.count_nonzero(chosen))
        if count == 0:
            return float("nan"), float("nan")
        value = uncertainty.fixed_sum(self.value(name)[chosen]) / count
        # A ZOI without predicted noise (sigma NaN) leaves the mean without a sigma, not without a value.
        own = np.sqrt(np.maximum(self._variance(name, self.covariance), 0))
        variance = uncertainty.variance_of_sum(np.where(chosen, own, 0.0), name, self.grid, self.window)
        sigma = float(np.sqrt(max(variance, 0.0)) / count) * self._beyond_overlap(name, where)
        if self.common is None:
            return value, sigma
        shares = np.zeros((6, *self.grid.shape))
        for i, share in uncertainty.combination(name).items():
            shares[i] = share * chosen / count
        return value, math.hypot(sigma, math.sqrt(self.common.variance_of_sum(shares)))

    def _beyond_overlap(self, name: str, where: ArrayLike | None) -> float:
        """Noise of a mean that the pattern of the ZOIs makes, over that which follows from their overlap."""
        if self.sums is None:
            return 1.0
        gauge = self.grid.active if where is None else self.grid.active & np.asarray(where, bool)
        return self.sums.factor(name, gauge)

    def strain(self, measure: uncertainty.Measure = "small") -> uncertainty.StrainTensor:
        """The strain of a measure: "small", "engineering" (elongations), "green" (Green-Lagrange) or "hencky".

        Raises
        ------
        ValueError
            Unknown measure.
        """
        return uncertainty.strain_tensor(measure, self.du_dx, self.du_dy, self.dv_dx, self.dv_dy)

    @property
    def rotation(self) -> uncertainty.Floats:
        """Finite rotation by polar decomposition of F = I + grad u, (R, C), rad."""
        return np.asarray(np.arctan2(self.dv_dx - self.du_dy, 2 + self.du_dx + self.dv_dy))

    @property
    def principal(self) -> tuple[uncertainty.Floats, uncertainty.Floats, uncertainty.Floats]:
        """Largest and smallest principal small strain and the angle of the first to x (rad)."""
        return self.strain("small").principal


def _filled(values: ArrayLike, grid: ZoiGrid) -> uncertainty.Floats:
    return np.array(np.broadcast_to(np.asarray(values, np.float64), grid.shape))
