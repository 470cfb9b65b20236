"""The specimen before a test: ``region`` finds it in the picture, ``placing`` puts gauges on it."""

from live.specimen.placing import auto_gauges, with_auto_gauges
from live.specimen.region import Look, Region, is_sought, look, region_of, searched, with_region

__all__ = [
    "Look",
    "Region",
    "auto_gauges",
    "is_sought",
    "look",
    "region_of",
    "searched",
    "with_auto_gauges",
    "with_region",
]
