"""The readout time of a camera, from pictures: bands of a flickering lamp, or a specimen that is moved."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence

import numpy as np

from acquire.errors import ConfigError, DataError
from acquire.frame import Frame
from analysis.field import StrainField
from analysis.optics import Readout, readout_of_bands, readout_of_motion

LAMPS_HZ = (100.0, 120.0)
BAND_PICTURES = 128
"""Pictures from which bands are measured, at most."""


def from_lamp(frames: Iterable[Frame], lamp_Hz: float) -> Readout:
    """From whole pictures of anything that stands still in the light of a lamp of ``lamp_Hz``.

    Raises
    ------
    DataError
        Too few pictures, or no bands that move through them.
    """
    taken = itertools.islice(frames, BAND_PICTURES)
    profiles = [frame.image.mean(axis=1, dtype=np.float64) for frame in taken]
    try:
        return readout_of_bands(np.array(profiles).reshape(len(profiles), -1), lamp_Hz)
    except ValueError as error:
        raise DataError(
            "{why}: a global shutter has none; take an exposure below 5 ms, a lamp that flickers, and a frame rate"
            " that does not divide its frequency",
            error,
        ) from None


def from_motion(t: Sequence[float], fields: Sequence[StrainField], height: int) -> Readout:
    """From the fields of a rigid specimen that is moved to and fro; times in s, of single pictures.

    Raises
    ------
    DataError
        Too few pictures, or too little motion.
    """
    u, v, du_dy, dv_dy = ([field.mean(name)[0] for field in fields] for name in ("u", "v", "du_dy", "dv_dy"))
    try:
        return readout_of_motion(t, (u, v), (du_dy, dv_dy), height)
    except ValueError as error:
        raise DataError("the readout time is not measured: {why}", error) from None


def rounded_ms(found: Readout) -> dict[str, float]:
    """The changes of a rig file; raises ConfigError where the time cannot be one of a shutter."""
    if not 0 < found.seconds < 10:
        raise ConfigError(
            "{ms:.3g} ms is no readout time; is the picture turned, or does the camera read upwards?",
            found.seconds * 1e3,
        )
    return {
        "camera.readout_ms": float(f"{found.seconds * 1e3:.5g}"),
        "camera.sigma_readout_ms": float(f"{found.sigma * 1e3:.2g}"),
    }
