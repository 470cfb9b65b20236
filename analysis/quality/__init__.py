"""What a picture, or a series of them, is worth before a test.

``exposure`` judges light and bits, ``pattern`` the speckle of each ZOI, ``specimen`` finds the speckled specimen
by what could be measured, ``transfer`` says what a ZOI resolves, ``steadiness`` how still a series is.
"""

from analysis.quality.exposure import Depth, Exposure, depth, exposure
from analysis.quality.pattern import ZoiPattern, speckle_radius, zoi_pattern
from analysis.quality.specimen import Specimen, find_specimen
from analysis.quality.steadiness import Steadiness, aliased, mains_of, steadiness
from analysis.quality.transfer import gauge_length, l10_strain

__all__ = [
    "Depth",
    "Exposure",
    "Specimen",
    "Steadiness",
    "ZoiPattern",
    "aliased",
    "depth",
    "exposure",
    "find_specimen",
    "gauge_length",
    "l10_strain",
    "mains_of",
    "speckle_radius",
    "steadiness",
    "zoi_pattern",
]
