"""The protocols of load cells and indicators: bytes to readings, and commands to bytes.

Pure: no ports, no threads, no clock; ``acquire.serial_line`` drives them. One file a protocol, which says
what its lines look like and what damage they do not let anyone detect; ``registry`` finds one by name,
``base`` is the contract, ``units`` has the units of force and mass.
"""

from acquire.protocols.base import Mode, Parser, Protocol, Reading
from acquire.protocols.registry import PROTOCOLS, find_protocol
from acquire.protocols.units import is_mass, newtons_per

__all__ = ["PROTOCOLS", "Mode", "Parser", "Protocol", "Reading", "find_protocol", "is_mass", "newtons_per"]
