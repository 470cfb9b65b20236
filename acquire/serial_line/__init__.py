"""A load cell on a serial port, or behind any URL that pyserial knows.

``cell`` reads, reconnects and tares; ``settings`` is what its address says, ``scaling`` makes newtons,
``clock`` stamps the samples, ``watch`` sees silence and floods, ``ports`` lists what is plugged in,
``identify`` finds out what talks.
"""

from acquire.serial_line import identify
from acquire.serial_line.cell import open_serial
from acquire.serial_line.ports import list_serial_ports

__all__ = ["identify", "list_serial_ports", "open_serial"]
