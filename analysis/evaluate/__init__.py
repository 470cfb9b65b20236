"""Figures from fields: what a test engineer or a map wants of them.

``gauges`` are virtual gauges and extensometers on a field, by the ``extension`` of two ends. ``tensile``
evaluates a test: a ``curve`` by one of the ``standards``, its ``elastic`` line and its ``strengths``, each a
``figure`` with an interval, from ``series`` of noisy values. ``lag`` tells how late the
load comes beside the frames. ``floor`` has the still phase of a test and the noise floor in it.
``deconvolution`` takes the blur of the ZOI off a map.
"""

from analysis.evaluate.curve import Curve, true_curve
from analysis.evaluate.deconvolution import deconvolved, effect
from analysis.evaluate.elastic import LoadAxis, load_axis, principal_direction
from analysis.evaluate.figure import CONFIDENCE, Figure
from analysis.evaluate.floor import FEWEST_STILL, NoiseFloor, evenly, noise_floor, still_phase
from analysis.evaluate.gauges import (
    AreaGauge,
    Gauge,
    GaugeValue,
    LineGauge,
    TransverseGauge,
    ZoiGauge,
    gauge_zois,
    measure_gauge,
)
from analysis.evaluate.lag import Track, find_lag
from analysis.evaluate.standards import STANDARDS, Band, Interval, Standard, free
from analysis.evaluate.tensile import Options, Span, TensileFigures, Zero, ZeroBy, evaluate_test

__all__ = [
    "CONFIDENCE",
    "FEWEST_STILL",
    "STANDARDS",
    "AreaGauge",
    "Band",
    "Curve",
    "Figure",
    "Gauge",
    "GaugeValue",
    "Interval",
    "LineGauge",
    "LoadAxis",
    "NoiseFloor",
    "Options",
    "Span",
    "Standard",
    "TensileFigures",
    "Track",
    "TransverseGauge",
    "Zero",
    "ZeroBy",
    "ZoiGauge",
    "deconvolved",
    "effect",
    "evaluate_test",
    "evenly",
    "find_lag",
    "free",
    "gauge_zois",
    "load_axis",
    "measure_gauge",
    "noise_floor",
    "principal_direction",
    "still_phase",
    "true_curve",
]
