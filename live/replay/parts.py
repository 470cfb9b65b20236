"""A long session measured in parts by several processes: each stores its results, and one replay joins them.

A part is a file of arrays: for each burst its description, the parameters, covariances and status of the fit. It has
no pictures, and not the motion that only the next burst needs.
"""

from __future__ import annotations

import dataclasses
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import NDArray

from acquire.errors import DataError
from acquire.events import Event, EventKind
from acquire.frame import Burst, frozen
from analysis import StrainField
from live.pipeline.consumer import Screen
from live.pipeline.measurement import Measurement
from live.pipeline.reference import unchanged
from live.replay.opening import open_session_source, prepare_replay, session_path
from live.replay.source import ReplayRequest, check_window, prefetch
from live.setup.prepared import PreparedKernel

if TYPE_CHECKING:
    from analysis import PhaseKernel

_BURST = np.dtype(
    [("n", "i8"), ("noise", "f8"), ("bits", "i8"), ("t", "f8"), ("duration", "f8"), ("first_index", "i8"),
     ("last_index", "i8"), ("lost", "i8"), ("clock", "U8"), ("motion_px", "f8"), ("field_noise", "f8")]
)  # fmt: skip
_ARRAYS = ("parameters", "covariance", "residual", "gain", "blur", "status", "iterations")
_NO_PICTURE = frozen(np.zeros((0, 0), np.float32))
_NOT_CLIPPED = frozen(np.zeros((0, 0), np.bool_))


def measure_part(request: ReplayRequest, file: IO[bytes], run_in: int, screen: Screen) -> bool:
    """Measure ``request.numbers`` of a session into ``file``, but for the first ``run_in`` of them.

    Returns
    -------
    bool
        Whether the part agrees with the whole; False where a reference was renewed, which later parts do not have, or
        where a burst failed.

    Raises
    ------
    ConfigError, DataError
        As ``replay``; also where ``request.source`` is no session.
    OSError
        ``file`` cannot be written.
    """
    path = session_path(request.source)
    if path is None:
        raise DataError("{source}: pictures are not measured in parts", request.source)
    check_window(request)
    renewed: list[Event] = []

    def listen(event: Event) -> None:
        if event.kind is EventKind.REFERENCE:
            renewed.append(event)

    failed: list[object] = []
    with open_session_source(path, request, screen) as (source, config):
        ready = prepare_replay(source, config, request.source, screen)
        work = prefetch(source.bursts)
        try:
            for m in ready.measurements(work, source.loads, listen, lambda *what: failed.append(what)):
                if renewed or failed:
                    return False
                if m.number >= run_in:
                    _put(m, file)
                screen.progress(m.time_step, m.number + 1, source.expected, 0.0)
        finally:
            work.close()
    return not renewed and not failed


def _put(m: Measurement, file: IO[bytes]) -> None:
    names = [name for name in _BURST.names or () if name != "field_noise"]
    described = (*(getattr(m.burst, name) for name in names), m.field.noise)
    for array in (np.array(described, _BURST), *(getattr(m.as_measured, name) for name in _ARRAYS)):
        np.save(file, array, allow_pickle=False)


@dataclass(frozen=True, slots=True, eq=False)
class _Stored:
    burst: Burst
    field: StrainField


class StoredResults:
    """Takes the place of a kernel, and gives the stored field of each burst."""

    def __init__(self, parts: Sequence[Path], ready: PreparedKernel) -> None:
        self._parts, self._ready = parts, ready
        self._fields: deque[StrainField] = deque()
        stored = dataclasses.replace(
            ready,
            plan=dataclasses.replace(ready.plan, correct=unchanged),
            kernel=cast("PhaseKernel", self),
            timer=lambda: 0.0,
        )
        self.measurements = stored.measurements

    @classmethod
    def of(cls, parts: Sequence[Path], ready: PreparedKernel) -> StoredResults | None:
        """Results of ``parts``; None without any."""
        return cls(parts, ready) if parts else None

    def bursts(self) -> Iterator[Burst]:
        """All bursts, without their pictures; raises DataError where a part is damaged."""
        for path in self._parts:
            for stored in _read(path, self._ready):
                self._fields.append(stored.field)
                yield stored.burst

    def measure(self, image: object, **_: object) -> StrainField:
        """The field of the next burst."""
        return self._fields.popleft()

    @property
    def period(self) -> NDArray[np.float64]:
        """Where the pattern of the reference repeats; see ``PhaseKernel.period``."""
        return self._ready.kernel.period

    def renewed(self, *_: object, **__: object) -> PhaseKernel:
        """Always raises: no part has a renewed reference."""
        raise ValueError("no reference was renewed")


def _read(path: Path, ready: PreparedKernel) -> Iterator[_Stored]:
    try:
        with path.open("rb") as file:
            while file.peek(1):
                described, *arrays = [np.load(file, allow_pickle=False) for _ in range(1 + len(_ARRAYS))]
                yield _stored(described, dict(zip(_ARRAYS, arrays, strict=True)), ready)
    except (OSError, ValueError, EOFError, KeyError) as error:
        raise DataError("{path}: cannot be read ({why}); remove it and call again", path, error) from error


def _stored(described: NDArray[Any], arrays: dict[str, Any], ready: PreparedKernel) -> _Stored:
    values = dict(zip(_BURST.names or (), described.item(), strict=True))
    noise = values.pop("field_noise")
    field = StrainField(
        grid=ready.plan.kernel_grid,
        covariance_reference=np.zeros_like(arrays["covariance"]),  # only a renewal asks for it
        noise=noise,
        window=ready.kernel.reference.settings.window,
        sums=ready.kernel.reference.sums,
        **arrays,
    )
    return _Stored(Burst(mean=_NO_PICTURE, clipped=_NOT_CLIPPED, **values), field)
