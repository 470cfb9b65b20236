"""Several cameras, of both sides or of fields of a specimen: the configuration of each as of a test of its own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from acquire.errors import ConfigError
from live.config.loading import Config, load_config
from live.config.sections import CameraConfig, OperateConfig, StrainOutConfig

FRONT, BACK = "front", "back"
SIDES = (FRONT, BACK)
"""Names of the sides, and of their folders in that of the test."""
FIELDS = ("first", "second", "third", "fourth", "fifth", "sixth", "seventh", "eighth")
"""Those of fields of view, which have no mean."""


def other_cameras(config: Config) -> tuple[str, ...]:
    """Addresses or rig files of the further cameras; none where there is one camera."""
    return (config.camera.back,) if config.camera.back else config.camera.beside


def names_of(config: Config) -> tuple[str, ...]:
    """The names of the cameras: sides with ``camera.back``, else fields; "" of a single one."""
    if config.camera.back is not None:
        return SIDES
    return FIELDS[: 1 + len(config.camera.beside)] if config.camera.beside else ("",)


def camera_configs(
    config: Config, overrides: Mapping[str, Any], own: Sequence[Config] = ()
) -> dict[str, Config]:
    """The configuration of each camera of ``config`` by its name, that of ``names_of``, the leading one first.

    Commands, alarms and strain outputs are those of the first.

    Parameters
    ----------
    config : Config
    overrides : mapping of "section.key" to a value
        As of the command line; for all, except those of the camera.
    own : sequence of Config, optional
        Of the further cameras, else read from their rig files, or made for their addresses.

    Raises
    ------
    ConfigError
        ``camera.back`` and ``camera.beside`` are both given; the rig file of a further camera cannot be read, or names
        no camera or a further one.
    """
    if config.camera.back is not None and config.camera.beside:
        raise ConfigError("give --back or --beside, not both: fields of a specimen are on one side of it")
    leading, *further = names_of(config)
    first = replace(config, camera=replace(config.camera, back=None, beside=()))
    others = [_joined(first, one) for one in own] or [
        _other(first, one, overrides) for one in other_cameras(config)
    ]
    quiet = (replace(one, alarm=(), operate=OperateConfig(), strain_out=StrainOutConfig()) for one in others)
    return {leading: first, **dict(zip(further, quiet, strict=True))}


def _other(first: Config, given: str, overrides: Mapping[str, Any]) -> Config:
    if given.lower().endswith(".toml"):
        return _of_file(first, given, overrides)
    # Plates and mask of the first are at other places in this picture: the specimen is found again.
    measure = first.measure if first.measure.mask is None else replace(first.measure, mask=None, roi=None)
    return replace(first, camera=CameraConfig(address=given), measure=measure, plate={})


def _of_file(first: Config, name: str, overrides: Mapping[str, Any]) -> Config:
    of_all = {key: value for key, value in overrides.items() if key.startswith("measure.")}
    own = load_config(Path(name), of_all)
    if not own.camera.address or other_cameras(own):
        raise ConfigError(
            "{name}: give camera.address, and no camera.back or camera.beside: this is the file of a further "
            "camera",
            name,
        )
    return _joined(first, own)


def _joined(first: Config, own: Config) -> Config:
    """What is of the camera from its own configuration, all else as of the first."""
    specimen = replace(first.specimen, axis=own.specimen.axis)
    return replace(
        first, camera=own.camera, measure=own.measure, scale=own.scale, gauges=own.gauges, plate=own.plate,
        specimen=specimen,
    )  # fmt: skip
