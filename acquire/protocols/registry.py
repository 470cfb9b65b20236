"""Every protocol by its name; a module is imported when it is first used."""

from __future__ import annotations

import importlib
from collections.abc import Mapping

from acquire.errors import ConfigError
from acquire.protocols.base import Protocol

# Imported when used; each module has a PROTOCOL.
PROTOCOLS: Mapping[str, str] = {
    "ascii": "acquire.protocols.ascii",
    "mt-sics": "acquire.protocols.mt_sics",
    "aed-standard": "acquire.protocols.aed_standard",
    "mark10": "acquire.protocols.mark10",
    "sauter": "acquire.protocols.sauter",
    "hbm-aed": "acquire.protocols.hbm_aed",
    "modbus": "acquire.protocols.modbus",
    "lines": "acquire.protocols.lines",
}


def find_protocol(name: str) -> Protocol:
    """The protocol called ``name``.

    Raises
    ------
    ConfigError
        Nobody knows it; lists those there are.
    """
    if name not in PROTOCOLS:
        raise ConfigError(f"no protocol is called {name!r}; there are: {', '.join(PROTOCOLS)}")
    protocol: Protocol = importlib.import_module(PROTOCOLS[name]).PROTOCOL
    return protocol
