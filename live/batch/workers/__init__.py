"""Who does the work: ``pool`` has processes of this machine do it (``worker`` is their side)."""

from live.batch.workers.pool import Pool

__all__ = ["Pool"]
