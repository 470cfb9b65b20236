"""What the response of the places is over: a channel of a finished run, and the instants that count."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from acquire.errors import ConfigError
from acquire.text import Message
from analysis.evaluate import Curve, TensileFigures
from analysis.evaluate.curve import Loading
from analysis.evaluate.programme import KindOfTest
from live.config.loading import Config
from live.pipeline.timed.response import CHANNELS, MEAN, STRESS, TIME
from live.results.row import gauge_columns
from live.results.run_folder import RunFolder

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Channel:
    """What the strains of the places are held against.

    Attributes
    ----------
    name : str
    x, sigma : (T,) float64
        With its noise: Pa, 1 or s.
    stress : (T,) float64 or None
        Where it is known: the places are elastic only up to where they leave their lines over it.
    rows : (K,) int
        The instants that count.
    """

    name: str
    x: Floats
    sigma: Floats
    stress: Floats | None
    rows: NDArray[np.intp]

    @classmethod
    def of(cls, run: RunFolder, figures: TensileFigures, name: str) -> Channel:
        """The channel ``name`` of a run with its ``figures``."""
        values, nothing = run.strain.values, np.zeros(run.strain.n)
        if name == TIME:
            return cls(name, run.strain.time_s, nothing, None, np.flatnonzero(np.isfinite(run.strain.time_s)))
        curve = run.curve
        loaded = bool(np.isfinite(curve.stress).any())
        if name == STRESS:
            x, sigma = curve.stress, nothing
        else:
            columns = (run.axial, f"sigma_{run.axial}") if name == MEAN else gauge_columns(name)[:2]
            x, sigma = (np.asarray(values[column], np.float64) for column in columns)
        if not loaded:
            curve = replace(curve, strain=x, stress=x)
        rows = _rising(curve, figures, run.specimen.test)
        return cls(name, x, sigma, curve.stress if loaded else None, rows[np.isfinite(x[rows])])


def _rising(curve: Curve, figures: TensileFigures, test: str) -> NDArray[np.intp]:
    """The instants at which the load rises as for E: by the same envelope, from where its interval begins."""
    programme = KindOfTest.of(curve, test)
    if programme.why:
        curve = programme.first_rise(curve)
    known = curve.stress[np.isfinite(curve.stress)]
    if known.size and -known.min() > known.max():
        curve = replace(curve, strain=-curve.strain, stress=-curve.stress)
    loading, first = Loading.of(curve), 0
    if figures.span is not None and loading.n:
        first = int(np.argmax(loading.level >= figures.span.stress[0]))
    return np.flatnonzero(np.isin(curve.t, loading.t[first : loading.top + 1]))


def check_channel(config: Config, *, forces: bool) -> None:
    """Refuse a channel that the test will not have; ``forces``: there are any.

    Raises
    ------
    ConfigError
    """
    name = config.output.response or ""
    if name == STRESS and not (forces and config.specimen.area_m2):
        what = Message("a section (--section W,T)") if forces else Message("forces (--load FILE.csv)")
        raise ConfigError("--response stress needs {what}; --response mean needs neither", what)
    if name not in ("", *CHANNELS, *config.gauges):
        known = ", ".join((*CHANNELS, *config.gauges))
        raise ConfigError("--response {name}: there is no such gauge; give one of {known}", name, known)
