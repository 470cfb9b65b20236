"""Measured fields on a grid, with their uncertainty.

``grid`` places the ZOIs and weighs their pixels, ``strain_field`` is the result with its ``status``,
``uncertainty`` has sigmas of values and means, ``motion`` predicts the next field, ``blocks`` are what is missing.
"""

from analysis.field.grid import WINDOWS, Motion, Roi, Status, Window, ZoiGrid, overlap, profile
from analysis.field.part import Block, Blur, area_share, blur_maps, in_blocks, mean_blur, part_of
from analysis.field.strain_field import StrainField
from analysis.field.uncertainty import (
    PAIR_INDEX,
    VALUES,
    CommonError,
    Measure,
    StrainTensor,
    Sums,
    combination,
    fixed_sum,
    fixed_sums,
    products,
    strain_tensor,
    stretched,
    variance_of_sum,
)

__all__ = [
    "PAIR_INDEX",
    "VALUES",
    "WINDOWS",
    "Block",
    "Blur",
    "CommonError",
    "Measure",
    "Motion",
    "Roi",
    "Status",
    "StrainField",
    "StrainTensor",
    "Sums",
    "Window",
    "ZoiGrid",
    "area_share",
    "blur_maps",
    "combination",
    "fixed_sum",
    "fixed_sums",
    "in_blocks",
    "mean_blur",
    "overlap",
    "part_of",
    "products",
    "profile",
    "strain_tensor",
    "stretched",
    "variance_of_sum",
]
