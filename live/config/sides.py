"""Two cameras, front and back of one specimen: the configuration of each as that of a test of its own."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from acquire.errors import ConfigError
from live.config.loading import Config, load_config
from live.config.sections import CameraConfig, OperateConfig, StrainOutConfig

FRONT, BACK = "front", "back"
SIDES = (FRONT, BACK)
"""Names of the sides, and of their folders in that of the test."""


def side_configs(config: Config, overrides: Mapping[str, Any]) -> dict[str, Config]:
    """The configurations of front and back of a ``config`` with ``camera.back``.

    Commands, alarms and strain outputs are those of the front.

    Parameters
    ----------
    config : Config
    overrides : mapping of "section.key" to a value
        As of the command line; for both sides, except those of the camera.

    Raises
    ------
    ConfigError
        The rig file of the back cannot be read, or names no camera or a third one.
    """
    assert config.camera.back is not None
    front = replace(config, camera=replace(config.camera, back=None))
    back = config.camera.back
    mine = _of_file(front, back, overrides) if back.lower().endswith(".toml") else _of_address(front, back)
    return {
        FRONT: front,
        BACK: replace(mine, alarm=(), operate=OperateConfig(), strain_out=StrainOutConfig()),
    }


def _of_address(front: Config, address: str) -> Config:
    """Plates and mask of the front are at other places in this picture: the specimen is found again."""
    measure = front.measure if front.measure.mask is None else replace(front.measure, mask=None, roi=None)
    return replace(front, camera=CameraConfig(address=address), measure=measure, plate={})


def _of_file(front: Config, name: str, overrides: Mapping[str, Any]) -> Config:
    of_both = {key: value for key, value in overrides.items() if key.startswith("measure.")}
    own = load_config(Path(name), of_both)
    if not own.camera.address or own.camera.back is not None:
        raise ConfigError(
            f"{name}: give camera.address, and no camera.back: this is the rig file of the back"
        )
    specimen = replace(front.specimen, axis=own.specimen.axis)
    return replace(
        front, camera=own.camera, measure=own.measure, scale=own.scale, gauges=own.gauges, plate=own.plate,
        specimen=specimen,
    )  # fmt: skip
