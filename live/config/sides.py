"""Two cameras, of both sides or of two fields of a specimen: the configuration of each as of a test of its own."""

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
FIELDS = ("first", "second")
"""Those of two fields of view, which have no mean."""


def second_camera(config: Config) -> str | None:
    """Address or rig file of a second camera; None where there is one camera."""
    return config.camera.back or config.camera.beside


def names_of(config: Config) -> tuple[str, str]:
    """The names of two cameras: sides with ``camera.back``, else fields."""
    return SIDES if config.camera.back is not None else FIELDS


def side_configs(
    config: Config, overrides: Mapping[str, Any], own: Config | None = None
) -> dict[str, Config]:
    """The configurations of both cameras of a ``config`` with ``camera.back`` or ``camera.beside``, by their names.

    Commands, alarms and strain outputs are those of the first.

    Parameters
    ----------
    config : Config
    overrides : mapping of "section.key" to a value
        As of the command line; for both, except those of the camera.
    own : Config, optional
        Of the second camera, else read from its rig file, or made for its address.

    Raises
    ------
    ConfigError
        Both keys are given; the rig file of the second cannot be read, or names no camera or a further one.
    """
    second = second_camera(config)
    assert second is not None
    if config.camera.back is not None and config.camera.beside is not None:
        raise ConfigError("give --back or --beside, not both: there are two cameras at most")
    front = replace(config, camera=replace(config.camera, back=None, beside=None))
    if own is not None:
        mine = _joined(front, own)
    else:
        of_file = second.lower().endswith(".toml")
        mine = _of_file(front, second, overrides) if of_file else _of_address(front, second)
    lead, other = names_of(config)
    return {
        lead: front,
        other: replace(mine, alarm=(), operate=OperateConfig(), strain_out=StrainOutConfig()),
    }


def _of_address(front: Config, address: str) -> Config:
    """Plates and mask of the front are at other places in this picture: the specimen is found again."""
    measure = front.measure if front.measure.mask is None else replace(front.measure, mask=None, roi=None)
    return replace(front, camera=CameraConfig(address=address), measure=measure, plate={})


def _of_file(front: Config, name: str, overrides: Mapping[str, Any]) -> Config:
    of_both = {key: value for key, value in overrides.items() if key.startswith("measure.")}
    own = load_config(Path(name), of_both)
    if not own.camera.address or second_camera(own) is not None:
        raise ConfigError(
            f"{name}: give camera.address, and no camera.back or camera.beside: this is the file of the second camera"
        )
    return _joined(front, own)


def _joined(front: Config, own: Config) -> Config:
    """What is of the camera from its own configuration, all else as of the front."""
    specimen = replace(front.specimen, axis=own.specimen.axis)
    return replace(
        front, camera=own.camera, measure=own.measure, scale=own.scale, gauges=own.gauges, plate=own.plate,
        specimen=specimen,
    )  # fmt: skip
