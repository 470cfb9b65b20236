"""Options of the command line that have an effect only with another setting, and are refused without it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

from acquire.errors import ConfigError
from acquire.text import Message
from live.config.loading import Config, options


def _has_load(config: Config) -> bool:
    return config.load.address != "none:"


def _sends_strain(config: Config) -> bool:
    out = config.strain_out
    return bool(out.tcp or out.udp or out.serial)


_NEEDS: dict[str, tuple[Callable[[Config], bool], str]] = {
    "load.lag_s": (_has_load, "--load"),
    "record.start_above_N": (lambda config: config.record.armed and _has_load(config), "--armed and --load"),
    "operate.token_file": (
        lambda config: bool(config.operate.orders) or _sends_strain(config),
        Message("--orders or --strain-out"),
    ),
    "strain_out.format": (_sends_strain, "--strain-out"),
    "strain_out.channels": (_sends_strain, "--strain-out"),
    "view.light": (lambda config: config.view.enabled, Message("the view: leave out --no-view")),
}
"""Key -> whether it has an effect in a live test, and what it needs; the file of the configuration may have that."""
OF_FORCES = ("load.unit", "load.column", "load.decimal")
"""Keys that say how a file of forces is read."""


def check_effect(given: Mapping[str, Any], config: Config) -> None:
    """Raises ConfigError for an option among ``given`` ("section.key" -> value) without effect in a live test."""
    for key, (is_used, needs) in _NEEDS.items():
        if key in given and not is_used(config):
            raise _unused(key, needs)


def check_forces(given: Iterable[str], needs: str) -> None:
    """Raises ConfigError for an option among ``given`` on the files of forces, of which there is none."""
    for key in OF_FORCES:
        if key in given:
            raise _unused(key, needs)


def without_forces(given: Iterable[str]) -> list[str]:
    """A note for each option among ``given`` on forces, of a replay in which none is known."""
    return [
        Message("note: --{option} has no effect, since no force is known", _option(key))
        for key in ("load.sign", "load.lag_s")
        if key in given
    ]


def _unused(key: str, needs: str) -> ConfigError:
    return ConfigError("--{option} has no effect here; it needs {needs}", _option(key), needs)


def _option(key: str) -> str:
    return next(name for name, (of, _) in options().items() if of == key)
