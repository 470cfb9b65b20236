"""The names of the channels, each with its unit."""

from __future__ import annotations

from collections.abc import Iterable

MEASURED_CHANNELS = {
    "time_s": "middle of the burst, s since the start of the test",
    "frame": "sequence number of its first frame",
    "axial": "strain along the load: the gauge axial, or else the mean",
    "sigma_axial": "its standard uncertainty",
    "strain_rate": "of axial over the last second, 1/s",
    "force_N": "the newest value of the load cell",
    "stress_MPa": "that over the section",
    "exx": "mean strain of the valid ZOIs",
    "eyy": "mean strain of the valid ZOIs",
    "exy": "mean strain of the valid ZOIs",
    "largest": "strain of largest magnitude of any ZOI",
    "lost_share": "share of the ZOIs that have no value, 0 to 1",
    "latency_s": "from the stamp of the last frame to the result, s",
    "noise_GL": "of one frame",
}
SYSTEM_CHANNELS = {
    "silent_s": "time since the last frame, s",
    "load_silent_s": "time since the last sample of the load cell, s",
    "disk_min": "until the disk is full, minutes",
}
DEFAULT_CHANNELS = (
    "time_s",
    "frame",
    "axial",
    "sigma_axial",
    "force_N",
    "stress_MPa",
    "lost_share",
    "latency_s",
)
"""What is told where nothing is chosen; the gauges beside."""


def channel_names(gauges: Iterable[str], *, system: bool = False) -> tuple[str, ...]:
    """All channels of a test with these gauges: ``gauge_NAME`` and ``sigma_gauge_NAME`` as in the files."""
    own = (f"{prefix}gauge_{name}" for name in gauges for prefix in ("", "sigma_"))
    return (*MEASURED_CHANNELS, *own, *(SYSTEM_CHANNELS if system else ()))
