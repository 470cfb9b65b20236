"""Figures from fields: what a test engineer or a map wants of them.

``tensile`` has E, nu and the strengths of a stress-strain curve, ``deconvolution`` takes the blur of the
ZOI off a map.
"""

from analysis.evaluate.deconvolution import deconvolved, effect
from analysis.evaluate.tensile import Tensile, tensile_figures

__all__ = ["Tensile", "deconvolved", "effect", "tensile_figures"]
