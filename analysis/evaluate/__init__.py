"""Figures from fields: what a test engineer or a map needs.

``gauges`` are virtual gauges and extensometers on a field, by the extension of two ends. ``tensile`` evaluates a
test: a ``curve`` by one of the standards (``tensile_figures``), its ``elastic`` line, its ``strengths``, its plastic
``flow``, each a ``figure`` with an interval; ``programme`` finds what kind of test it is, ``seen`` what of the force
was seen. ``lag`` is the delay of the load beside the frames. ``figure`` has the still phase of a test and the noise
floor in it too. ``deconvolution`` removes the blur of the ZOI from a map. ``response`` has what each place does over
all instants.
"""

from analysis.evaluate.area_strain import AreaStrain, Unevenness
from analysis.evaluate.curve import Course, Curve, TwoSides, true_curve
from analysis.evaluate.deconvolution import deconvolved, effect
from analysis.evaluate.elastic import ErrorLimits, LoadAxis, load_axis, principal_direction
from analysis.evaluate.figure import (
    AT_LEAST,
    CONFIDENCE,
    MIN_STILL_INSTANTS,
    Figure,
    NoiseFloor,
    evenly,
    noise_floor,
    still_phase,
)
from analysis.evaluate.flow import Neck, neck, true_at_top
from analysis.evaluate.gauges.extensometers import (
    REGION,
    ExtensionGauge,
    LineGauge,
    RegionStrips,
    TransverseGauge,
)
from analysis.evaluate.gauges.gauge import AUTO_GAUGES, Gauge, Parameter
from analysis.evaluate.gauges.geometry import inside_polygon
from analysis.evaluate.gauges.kinds import GAUGE_KINDS, AreaGauge, CircleGauge, StripGauge, ZoiGauge
from analysis.evaluate.gauges.readings import GaugeSet, GaugeValue, distance, facing
from analysis.evaluate.gauges.taken import COME_APART
from analysis.evaluate.lag import Track, find_lag
from analysis.evaluate.programme import KINDS, Kind
from analysis.evaluate.tensile import evaluate_test
from analysis.evaluate.tensile_figures import (
    STANDARDS,
    Band,
    Interval,
    Span,
    Standard,
    StrainZero,
    TensileFigures,
    TensileOptions,
    ZeroBy,
    free,
)

__all__ = [
    "AT_LEAST",
    "AUTO_GAUGES",
    "COME_APART",
    "CONFIDENCE",
    "GAUGE_KINDS",
    "KINDS",
    "MIN_STILL_INSTANTS",
    "REGION",
    "STANDARDS",
    "AreaGauge",
    "AreaStrain",
    "Band",
    "CircleGauge",
    "Course",
    "Curve",
    "ErrorLimits",
    "ExtensionGauge",
    "Figure",
    "Gauge",
    "GaugeSet",
    "GaugeValue",
    "Interval",
    "Kind",
    "LineGauge",
    "LoadAxis",
    "Neck",
    "NoiseFloor",
    "Parameter",
    "RegionStrips",
    "Span",
    "Standard",
    "StrainZero",
    "StripGauge",
    "TensileFigures",
    "TensileOptions",
    "Track",
    "TransverseGauge",
    "TwoSides",
    "Unevenness",
    "ZeroBy",
    "ZoiGauge",
    "deconvolved",
    "distance",
    "effect",
    "evaluate_test",
    "evenly",
    "facing",
    "find_lag",
    "free",
    "inside_polygon",
    "load_axis",
    "neck",
    "noise_floor",
    "principal_direction",
    "still_phase",
    "true_at_top",
    "true_curve",
]
