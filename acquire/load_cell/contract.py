"""The contract of a load cell.

A load cell is a context manager and an iterable of load samples; ``tests/contracts``
holds all of them to this text.
"""

from __future__ import annotations

from collections.abc import Iterator
from types import TracebackType
from typing import Protocol, Self, runtime_checkable

from acquire.load_sample import LoadCellInfo, LoadSample


@runtime_checkable
class LoadCell(Protocol):
    """What every load cell does.

    - Opening (``open_load_cell``) claims the port and raises ``ConfigError`` or
      ``DeviceError`` where that fails; ``info`` is complete from then on.
    - ``with`` starts the stream and closes everything at its end; one never entered is closed
      with ``close()``. Both may be called again without effect.
    - Iterating gives ``LoadSample`` objects with non-decreasing ``t`` until ``stop()``, or until
      a finite source is exhausted. A lost or silent port is an event and a reconnection, never
      an exception: a test goes on without its load.
    - ``stop()`` may be called from any thread; the iteration then ends within half a second.
    - ``tare()`` makes the present load zero, in the device where its protocol can, else here; may be
      called from any thread while iterating. Unless forced it is refused, in an event, where the load
      is not known to be still. Its event says by how much forces fall from then on (``step_N``).
    - ``undo_tare()`` lets zero be where it was before; it tells the like.
    """

    @property
    def info(self) -> LoadCellInfo: ...

    def __enter__(self) -> Self: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...

    def __iter__(self) -> Iterator[LoadSample]: ...

    def tare(self, *, force: bool = False) -> None: ...

    def undo_tare(self) -> None: ...

    def stop(self) -> None: ...

    def close(self) -> None: ...
