"""A load cell on a serial port, or behind any URL that pyserial knows.

``cell`` is the stream of samples; ``settings`` is what its address says, ``link`` opens the port again and
again, ``byte_ports`` and ``rfc2217`` are ports as bytes, ``scaling`` makes newtons, ``zero`` is the tare,
``clock`` stamps the samples and knows the late ones, ``watch`` sees silence and floods, ``ports`` lists what
is plugged in, ``identify`` finds out what talks.
"""

from acquire.serial_line import identify
from acquire.serial_line.cell import open_serial
from acquire.serial_line.ports import LineSettings, list_serial_ports, open_port

__all__ = ["LineSettings", "identify", "list_serial_ports", "open_port", "open_serial"]
