"""Figures from fields: what a test engineer or a map wants of them.

``gauges`` are virtual gauges and extensometers on a field, by the ``extension`` of two ends. ``tensile`` has E, nu and the strengths of a stress-strain curve, ``deconvolution`` takes the blur of the
ZOI off a map.
"""

from analysis.evaluate.deconvolution import deconvolved, effect
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
from analysis.evaluate.tensile import Tensile, tensile_figures

__all__ = [
    "AreaGauge",
    "Gauge",
    "GaugeValue",
    "LineGauge",
    "Tensile",
    "TransverseGauge",
    "ZoiGauge",
    "deconvolved",
    "effect",
    "gauge_zois",
    "measure_gauge",
    "tensile_figures",
]
