"""Bytes of a message that only silence, or its length, ends: kept up to a bound, with their position."""

from __future__ import annotations


class HeldBytes:
    """What has come since the last message.

    Parameters
    ----------
    limit : int, bytes
        More than this without a message is counted and not kept.
    """

    def __init__(self, limit: int) -> None:
        self._limit = limit
        self._received = self._start = 0
        self.data = bytearray()

    def add(self, data: bytes) -> None:
        """Bytes have come."""
        if not self.data:
            self._start = self._received
        self.data += data[: self._limit - len(self.data)]
        self._received += len(data)

    def take(self, size: int) -> tuple[bytes, int]:
        """The first ``size`` bytes, and the number of the first of them; they are held no longer."""
        taken, start = bytes(self.data[:size]), self._start
        del self.data[:size]
        self._start += size
        return taken, start

    def clear(self, lost: int = 0) -> None:
        """Forget all of it, and count ``lost`` bytes never added."""
        self.data.clear()
        self._received += lost
