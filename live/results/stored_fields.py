"""What the files of a run hold: strain fields and pictures of measured instants, and readings of the load by the piece.

24 h of readings at 1 kHz are 86 million, more than memory holds. A figure goes through all of them. A curve of more
than ``MOST`` is thinned: of each of equally many readings in a row it has the first, the lowest, the highest, and the
first without a value. The lag is looked for in the ``MOST`` readings from the first picture on.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from acquire.camera import Camera, CroppedCamera, open_camera
from acquire.errors import ConfigError, DataError, PhasedicError
from acquire.frame import CameraInfo
from acquire.load_cell import LoadLog
from acquire.record_mode import Crop
from acquire.session import Session
from analysis.evaluate import ExtensionGauge, Figure, RegionStrips, Track, distance, facing, find_lag
from analysis.evaluate.affine import Places, noise_of_windows
from analysis.field import PAIR_INDEX, WINDOWS, Measure, StrainField, Window
from live.config.gauges import gauges_for
from live.config.loading import from_dict
from live.results.reader import Strain

MOST = 1 << 21
"""Readings that are held at once: 35 minutes at 1 kHz."""
_BEFORE_S = 2.0  # of readings that come before the first picture: a lag may be as large

Item = TypeVar("Item")
_GRADIENTS = ("du_dx", "du_dy", "dv_dx", "dv_dy")
_DU_DY, _DV_DX = 2, 4  # of u, du_dx, du_dy, v, dv_dx, dv_dy

Image = NDArray[Any]


class Readings:
    """Times (s) and forces (N).

    Parameters
    ----------
    pieces : callable
        Gives an iterator of them in order of time.
    """

    def __init__(self, pieces: Callable[[], Iterator[Track]]) -> None:
        self.pieces = pieces

    @classmethod
    def of(cls, t: NDArray[np.float64], values: NDArray[np.float64]) -> Readings:
        """In one piece."""
        return cls(lambda: iter([Track(t, values)]))

    @classmethod
    def of_log(cls, loads: LoadLog, *, zero_of: float | None = None, late_s: float = 0.0) -> Readings:
        """Those of a log, ``late_s`` earlier and as if the zero of the time ``zero_of`` had held."""
        return cls(lambda: (Track(t - late_s, force) for t, force in loads.pieces(zero_of)))

    @cached_property
    def count(self) -> int:
        """How many there are."""
        return sum(len(piece.t) for piece in self.pieces())

    @cached_property
    def curve(self) -> Track:
        """All, or those of a curve of at most about ``MOST``."""
        return self.thinned(MOST)

    def thinned(self, most: int) -> Track:
        """At most about so many; all where there are no more."""
        each = math.ceil(3 * self.count / most) if self.count > most else 1
        return Track.joined([_thinned(piece, each) for piece in self.pieces()])

    def first(self, since: float = -math.inf) -> Track:
        """All, or the first ``MOST`` from the time ``since`` on."""
        if self.count <= MOST:
            return self.curve
        found, left = list[Track](), MOST
        for piece in self.pieces():
            begin = int(np.searchsorted(piece.t, since))
            found.append(Track(piece.t[begin : begin + left], piece.values[begin : begin + left]))
            left -= len(found[-1].t)
            if not left:
                break
        return Track.joined(found)

    def lag_behind(self, strain: Track) -> Figure:
        """By how much they are stamped later than the strain that they belong to, s."""
        if self.count <= MOST or not len(strain.t):
            return find_lag(strain, self.curve)
        force = self.first(float(strain.t[0]) - _BEFORE_S)
        stop = int(np.searchsorted(strain.t, force.t[-1])) if len(force.t) else 0
        return find_lag(Track(strain.t[:stop], strain.values[:stop]), force)


def _thinned(piece: Track, each: int) -> Track:
    if each == 1:
        return piece
    n, unknown = len(piece.t), np.isnan(piece.values)
    rows = np.append(piece.values, np.full(-n % each, math.nan)).reshape(-1, each)
    lowest, highest = (
        one(np.where(np.isnan(rows), unlike, rows), axis=1)
        for one, unlike in ((np.argmin, math.inf), (np.argmax, -math.inf))
    )
    starts = np.arange(0, n, each)
    firsts = np.append(unknown, np.zeros(-n % each, bool)).reshape(-1, each).argmax(axis=1)
    chosen: NDArray[np.intp] = np.unique(
        [starts, starts + lowest, starts + highest, starts + firsts, 0 * starts + n - 1]
    )
    return Track(piece.t[chosen], piece.values[chosen])


class StoredPattern:
    """The weights of ZOIs in areas, as they were during the test; of their noise only the overlap of the windows.

    Fulfils ``Sums``.

    Parameters
    ----------
    normal : (21, R, C) float32
        Upper triangles of the normal matrices.
    places : Places
    """

    def __init__(self, normal: NDArray[np.float32], places: Places) -> None:
        self._normal, self._places = normal.reshape(len(normal), -1).astype(np.float64), places
        self._made: dict[Hashable, Any] = {}

    def factor(self, name: str, where: NDArray[np.bool_]) -> float:
        """See ``Sums``: as windows overlap."""
        return 1.0

    def information(self, at: NDArray[np.intp]) -> NDArray[np.float64]:
        """See ``Sums``."""
        out = np.empty((6, 6, len(at)))
        for one, (i, j) in zip(self._normal[:, at], zip(*np.triu_indices(6), strict=True), strict=True):
            out[i, j] = out[j, i] = one
        return out

    def variance(self, at: NDArray[np.intp], weights: NDArray[np.float64]) -> float:
        """See ``Sums``: as windows overlap."""
        return noise_of_windows(self._places, at, weights)

    def unit_variances(self, at: NDArray[np.intp]) -> NDArray[np.float64]:
        """See ``Sums``: all alike."""
        return np.ones((2, len(at)))

    def kept(self, key: Hashable, make: Callable[[], Item]) -> Item:
        """See ``Sums``."""
        if key not in self._made:
            self._made[key] = make()
        found: Item = self._made[key]
        return found


def read_field(strain: Strain, row: int) -> StrainField:
    """The field of ``row``; covariances that the stored sigmas do not give are 0.

    Raises
    ------
    DataError
        There is no such row, or it cannot be read.
    """
    maps = {name: np.asarray(strain.maps(name, row), np.float64) for name in ("u", "v", *_GRADIENTS)}
    sigmas = {name: np.asarray(strain.maps(f"sigma_{name}", row), np.float64) for name in maps}
    status, residual = strain.maps("status", row), strain.maps("residual", row)
    field = StrainField.from_values(strain.grid, maps, sigmas, status=status, residual=residual)
    covariance = np.array(field.covariance)
    shear = np.asarray(strain.maps("sigma_exy", row), np.float64)
    both = sigmas["du_dy"] ** 2 + sigmas["dv_dx"] ** 2
    covariance[PAIR_INDEX[_DU_DY, _DV_DX]] = (4 * shear**2 - both) / 2
    measure = cast(Measure, strain.strain_measure)
    return replace(field, covariance=covariance, measure=measure, window=window_of(strain))


def stored_pattern(strain: Strain, reference: int) -> StoredPattern:
    """The weights of the ZOIs against a reference (``Strain.reference``).

    Raises
    ------
    DataError
        They cannot be read, or are none.
    """
    normal = strain.normal(reference)
    i, j = np.triu_indices(6)
    if not (
        np.isfinite(normal).all() and (normal[i == j] >= 0).all() and (normal[i == j] > 0).all(axis=0).any()
    ):
        raise DataError(
            "{path}: its normal matrices are damaged; make it again with phasedic replay", strain.path
        )
    return StoredPattern(normal, Places.of(strain.grid, window_of(strain)))


def window_of(strain: Strain) -> Window:
    """The window of the ZOIs, on which the correlation of neighbours depends; gaussian where it is not recorded."""
    measure = strain.config.get("measure")
    name = measure.get("window") if isinstance(measure, dict) else None
    return cast(Window, name) if name in WINDOWS else "gaussian"


def length_between(strain: Strain, axis: Literal["x", "y"], described: Mapping[str, Any] | None) -> float:
    """L0 of the extension, px: between strips along ``axis``, where they face each other, or between the ends of the
    gauge ``described``; NaN without ends."""
    ends, along = RegionStrips(axis).zois(strain.grid), str(axis)
    if described is not None:
        try:
            table = from_dict({"gauges": {"axial": dict(described)}}, {}, str(strain.path)).gauges
            gauge = gauges_for(table, axis, strain.grid)[0]
        except ConfigError:  # a file of another version
            return math.nan
        ends, along = gauge.zois(strain.grid), gauge.along if isinstance(gauge, ExtensionGauge) else ""
    return distance(strain.grid, (along and facing(ends, along)) or ends)


@dataclass(frozen=True, slots=True, eq=False)
class Pictures:
    """Pictures by row of the results.

    Attributes
    ----------
    info : CameraInfo
        Size and bits.
    each : callable
        Takes rows in ascending order, gives the (H, W) image of each, in grey levels; None for one that is not
        readable, which may also raise DataError.
    """

    info: CameraInfo
    each: Callable[[Sequence[int]], Iterator[Image | None]]


def of_session(session: Session, strain: Strain) -> Pictures | None:
    """Pictures of a recording: the frame (or burst) nearest to the middle of each measured burst."""
    bursts = session.mode.kind == "bursts"
    n = session.burst_count if bursts else len(session)
    if not n:
        return None
    times = _BurstTimes(session) if bursts else [float(t) for t in session.times]

    def each(rows: Sequence[int]) -> Iterator[Image | None]:
        for row in rows:
            number = _nearest(times, n, float(strain.time_s[row]) + session.start_monotonic)
            yield session.burst(number).mean if bursts else session.frame(number).image

    return Pictures(session.camera, each)


def of_images(address: str, strain: Strain, crop: Crop | None = None) -> Pictures:
    """Pictures that a replay measured, cropped to ``crop`` (x, y, width, height).

    Raises as ``open_camera`` where they cannot be found any more.
    """
    with _opened(address, crop) as camera:
        info = camera.info

    def each(rows: Sequence[int]) -> Iterator[Image | None]:
        with _opened(address, crop) as again:
            yield from _numbered(again, [int(strain.values["frame"][row]) for row in rows])

    return Pictures(info, each)


def _opened(address: str, crop: Crop | None) -> Camera:
    camera = open_camera(address)
    if crop is None:
        return camera
    try:
        return CroppedCamera(camera, crop)
    except PhasedicError:
        camera.close()
        raise


def _numbered(camera: Camera, numbers: Sequence[int]) -> Iterator[Image]:
    wanted = iter(numbers)
    number = next(wanted, None)
    for frame in camera:
        while number is not None and frame.index >= number:
            yield frame.image
            number = next(wanted, None)
        if number is None:
            return


class _BurstTimes(Sequence[float]):
    """Times of recorded bursts, read on access."""

    def __init__(self, session: Session) -> None:
        self._session = session

    def __len__(self) -> int:
        return self._session.burst_count

    def __getitem__(self, number: Any) -> Any:
        return self._session.burst(number).t


def _nearest(times: Sequence[float], n: int, t: float) -> int:
    after = bisect_left(times, t, 0, n)
    if after == n:
        return n - 1
    return after - 1 if after and t - times[after - 1] < times[after] - t else after
