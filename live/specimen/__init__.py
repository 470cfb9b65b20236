"""Where the specimen is in the picture, before a test: ``region``."""

from live.specimen.region import Look, Region, is_sought, look, region_of, searched, with_region

__all__ = ["Look", "Region", "is_sought", "look", "region_of", "searched", "with_region"]
