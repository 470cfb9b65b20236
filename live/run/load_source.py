"""The load cell as a source of the stream: its thread publishes the samples, which are those of every camera."""

from __future__ import annotations

import logging
import threading

from acquire.errors import PhasedicError
from acquire.load_cell import LoadCell
from acquire.system import lower_priority
from live.pipeline.latency import LOAD
from live.stream.stream import LoadEnded, Stream

log = logging.getLogger(__name__)


class LoadSource:
    """Reads ``cell`` in its own thread; a failure there never ends the images.

    Parameters
    ----------
    cell : LoadCell
    stream : Stream
        Takes each LoadSample, and LoadEnded at the end.
    """

    def __init__(self, cell: LoadCell, stream: Stream) -> None:
        self._cell, self._stream = cell, stream
        self._thread = threading.Thread(target=self._work, name="load", daemon=True)

    def start(self) -> None:
        """Begin; the load cell must have been entered."""
        self._thread.start()

    def stop(self) -> None:
        """End it."""
        self._cell.stop()

    def join(self) -> None:
        """Wait for the end, where it was started."""
        if self._thread.ident is not None:
            self._thread.join()

    def _work(self) -> None:
        lower_priority(LOAD)
        error: Exception | None = None
        try:
            for sample in self._cell:
                self._stream.publish(sample)
        except Exception as found:
            if not isinstance(found, PhasedicError):
                log.exception("the load thread failed")
            error = found
        finally:
            self._stream.publish(LoadEnded(error))
