"""The specimen before a test, free of terminal and page.

``region`` finds it in the picture, ``placing`` puts gauges on it, ``drawing`` shows it, ``proposal`` writes
the rig down.
"""

from live.specimen.drawing import Overlay, outline, snapshot
from live.specimen.placing import auto_gauges, with_auto_gauges
from live.specimen.proposal import Proposal, propose, rig_text
from live.specimen.region import (
    Look,
    Region,
    is_sought,
    look,
    mask_picture,
    region_of,
    searched,
    with_region,
)

__all__ = [
    "Look",
    "Overlay",
    "Proposal",
    "Region",
    "auto_gauges",
    "is_sought",
    "look",
    "mask_picture",
    "outline",
    "propose",
    "region_of",
    "rig_text",
    "searched",
    "snapshot",
    "with_auto_gauges",
    "with_region",
]
