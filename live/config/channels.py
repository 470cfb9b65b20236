"""The channels that alarms and strain output can use, each with its meaning and unit."""

from __future__ import annotations

from collections.abc import Iterable

MEASURED_CHANNELS = {
    "time_s": "middle of the burst, s since the start of the test",
    "frame": "sequence number of the first frame of the burst",
    "axial": "strain along the load: the gauge axial, else of the region",
    "sigma_axial": "standard uncertainty of axial",
    "age_s": "age of the strains, s",
    "strain_rate": "rate of axial over the last second, 1/s",
    "force_N": "newest value of the load cell, N",
    "force_age_s": "its age, s",
    "stress_MPa": "force over the area of the section",
    "exx": "strain of the region: one affine field through its valid ZOIs",
    "eyy": "strain of the region: one affine field through its valid ZOIs",
    "exy": "strain of the region: one affine field through its valid ZOIs",
    "largest": "strain of the largest magnitude of any ZOI",
    "lost_share": "share of the ZOIs without a value, 0 to 1",
    "latency_s": "time from the stamp of the last frame to the result, s",
    "noise_GL": "noise of one frame, grey levels",
}
CYCLE_CHANNELS = {
    "cycle": "number of the last whole cycle of a cyclic test",
    "peak_strain": "highest axial strain in it",
    "range_strain": "range of the axial strain in it",
    "peak_N": "highest force in it, N",
    "secant_modulus": "range of the stress over that of the strain in it, Pa; of the force, N, without a section",
}
"""Of the last whole cycle."""
MEASURED_CHANNELS |= CYCLE_CHANNELS
JOINT_CHANNELS = {
    "mean_time_s": "the newest instant that front and back both have, s since the start of the test",
    "mean_axial": "axial strain then, mean of front and back",
    "bending_axial": "axial strain of the front then, minus that mean",
    "sigma_mean_axial": "standard uncertainty of mean_axial and of bending_axial",
}
"""Of a test with two cameras, front and back."""
_JOINT = ("mean_", "bending_", "sigma_mean_")
STATE_CHANNELS = {
    "state": "of the strains: live, old, unknown, not yet, paused, ended",
    "force_state": "of the force: live, old, unknown, overload, underload, not yet, ended",
}
"""Words, of the strain output alone."""
SYSTEM_CHANNELS = {
    "silent_s": "time since the last frame, s",
    "load_silent_s": "time since the last value of the load cell, s",
    "disk_min": "time until the disk is full, minutes",
}
OF_LOAD = ("force_N", "force_age_s", "force_state", "stress_MPa", "peak_N", "secant_modulus")
"""Channels that there are with a load cell alone."""
OF_SECTION = {"stress_MPa", "secant_modulus"}
"""Channels that are stresses."""
DEFAULT_CHANNELS = (
    "time_s",
    "frame",
    "axial",
    "sigma_axial",
    "strain_rate",
    "age_s",
    "state",
    "force_N",
    "stress_MPa",
    "force_age_s",
    "force_state",
    "lost_share",
    "latency_s",
)
"""The channels of the strain output without a choice; the gauges are added."""


def channel_names(gauges: Iterable[str], *, system: bool = False) -> tuple[str, ...]:
    """All channels of a test with these gauges: ``gauge_NAME`` and ``sigma_gauge_NAME`` as in the files."""
    gauges = tuple(gauges)
    own = (f"{prefix}gauge_{name}" for name in gauges for prefix in ("", "sigma_"))
    return (
        *MEASURED_CHANNELS,
        *own,
        *joint_channels(gauges),
        *(SYSTEM_CHANNELS if system else STATE_CHANNELS),
    )


def joint_channels(gauges: Iterable[str]) -> tuple[str, ...]:
    """The channels of front and back together, with those of these gauges."""
    return (*JOINT_CHANNELS, *(f"{prefix}gauge_{name}" for name in gauges for prefix in _JOINT))


def is_joint(channel: str) -> bool:
    """Whether a channel is of front and back together."""
    return channel.startswith(_JOINT)
