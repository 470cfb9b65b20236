"""From a driver's sequence numbers to the numbers of a test: never back, gaps counted.

Pure: knows nothing of devices and reads no clock.
"""

from __future__ import annotations

from acquire.camera import missing_between

_WRAP = 2**32


class FrameCounter:
    """Numbers frames over the whole run, also when the driver starts again at zero.

    Attributes
    ----------
    index : int
        Of the last frame; -1 before the first.
    t : float, s
        Its stamp.
    counts_itself : bool
        False once the driver's numbers have been found not to count.
    """

    def __init__(self) -> None:
        self.index = -1
        self.t = float("-inf")
        self.counts_itself = True
        self._sequence: int | None = None

    def restart(self) -> None:
        """The stream was opened anew: the driver's numbers begin again."""
        self._sequence = None

    def count(self, sequence: int, t: float, fps: float | None) -> int:
        """Take the next frame and give how many were lost before it.

        Parameters
        ----------
        sequence : int
            The driver's number, 32 bits.
        t : float, s
            Its stamp.
        fps : float or None, 1/s
            For frames lost while the device was away, told by the time that passed.
        """
        lost = self._lost(sequence, t, fps)
        if self.index < 0 and self._sequence is None:
            self.index = sequence
        else:
            self.index += 1 + lost
        self._sequence, self.t = sequence, max(t, self.t)
        return lost

    def _lost(self, sequence: int, t: float, fps: float | None) -> int:
        if self.index < 0:
            return 0
        if self._sequence is None:
            return missing_between(self.t, t, fps)
        step = (sequence - self._sequence) % _WRAP
        if 0 < step < _WRAP // 2:
            return step - 1
        self.counts_itself = False
        return missing_between(self.t, t, fps)
