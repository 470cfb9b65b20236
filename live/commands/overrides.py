"""What the command line sets, as "section.key" -> value."""

from __future__ import annotations

import argparse
from typing import Any

_KEYS = {
    "camera": "camera.address",
    "load": "load.address",
    "crop": "camera.crop",
    "dark": "camera.dark",
    "flat": "camera.flat",
    "roi": "measure.roi",
    "mask": "measure.mask",
    "zoi": "measure.zoi",
    "step": "measure.step",
    "burst": "measure.burst",
    "reference_burst": "measure.reference_burst",
    "window": "measure.window",
    "estimator": "measure.estimator",
    "order": "measure.order",
    "bending": "measure.bending_px",
    "noise": "measure.noise_GL",
    "record": "record.mode",
    "axis": "specimen.axis",
    "out": "output.dir",
    "seconds": "output.seconds",
}


_SWITCHES = {"no_record": "record.enabled", "no_view": "view.enabled", "no_rrd": "view.rrd"}


def overrides(arguments: argparse.Namespace) -> dict[str, Any]:
    """What the command line sets, as "section.key" -> value."""
    given = vars(arguments)
    found = {key: given[name] for name, key in _KEYS.items() if given.get(name) is not None}
    found |= {key: False for name, key in _SWITCHES.items() if given.get(name)}
    if given.get("section"):
        found |= _section(given["section"])
    for pair in given.get("meta") or ():
        key, _, value = pair.partition("=")
        found[f"metadata.{key}"] = value
    return found


def _section(text: str) -> dict[str, float]:
    from acquire.errors import ConfigError

    try:
        width, thickness = (float(part) for part in text.split(","))
    except ValueError:
        raise ConfigError(f"--section {text}: give width,thickness in mm, for example 10,2") from None
    return {"specimen.width_mm": width, "specimen.thickness_mm": thickness}
