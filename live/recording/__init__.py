"""Recording that begins and ends on an order: ``gate`` stands before the recorder."""

from live.recording.gate import Gate, Keep, Recorded

__all__ = ["Gate", "Keep", "Recorded"]
