"""Lines of text to and from other programs over TCP: ``server`` has the clients, ``place`` says where it listens."""

from live.lines.client import Client
from live.lines.place import Place, listening, read_token
from live.lines.server import LineServer

__all__ = ["Client", "LineServer", "Place", "listening", "read_token"]
