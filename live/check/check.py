"""``phasedic check``: is the picture good enough, before the specimen is pulled?

A burst of the still specimen is taken and judged: light, saturation, flicker, noise, contrast,
speckle size, sharpness, ZOIs without pattern, motion; and the strain noise floor is *measured*, from
one half of the burst against the other, beside the one predicted. Exit code 6 where it is not ready.
"""

from __future__ import annotations

from acquire.errors import ConfigError, DataError
from acquire.events import ignore_event
from acquire.frame import CameraInfo, Frame
from live.measure import Reference, ReferenceTaker
from live.setup import DEFAULT_REFERENCE_BURST, Config, open_rig

FEWEST = 8  # frames
RADIUS_PX = (1.2, 6.0)
MOST_CLIPPED, MOST_FLICKER, LEAST_CONTRAST, MOST_WITHOUT_PATTERN = 1e-4, 0.01, 0.05, 0.02


def take(config: Config) -> tuple[Reference, list[float], CameraInfo]:
    """A reference burst, the mean level of each of its frames, and the camera."""
    n = config.measure.reference_burst or DEFAULT_REFERENCE_BURST
    if n < FEWEST:
        raise ConfigError(f"measure.reference_burst = {n} is too short for a check; allowed: from {FEWEST}")
    rig = open_rig(config.camera.address, "none:", ignore_event, crop=config.camera.crop)
    taker, means = ReferenceTaker(n), list[float]()
    try:
        with rig.camera:
            for frame in rig.camera:
                means.append(_level(frame))
                if (taken := taker.add(frame)) is not None:
                    return taken, means, rig.camera.info
    finally:
        rig.close()
    raise DataError(f"{config.camera.address}: gave fewer than {n} frames without a gap; look at the camera")


def _level(frame: Frame) -> float:
    return float(frame.image[::4, ::4].mean())
