"""The folder of a finished run: results, recording and settings together.

with open_run("runs/20261122T081747Z") as run:
    run.strain.values["eyy"], run.stress
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquire.camera import with_scheme
from acquire.errors import ConfigError, DataError, PhasedicError
from acquire.events import Event, EventKind
from acquire.load_sample import LoadSample
from acquire.opening import Closing
from acquire.record_mode import Crop
from acquire.session import Session
from acquire.text import Message
from analysis.evaluate import Curve, Figure, LoadAxis, Track, load_axis
from analysis.field import StrainField
from live.config.cameras import FIELDS, SIDES
from live.config.loading import from_dict
from live.config.sections import SpecimenConfig
from live.pipeline.history import curve_of
from live.pipeline.measurement import AXIAL, TRANSVERSE, strains_along
from live.results.layout import gauge_columns
from live.results.reader import Strain
from live.results.stored_fields import (
    Image,
    Pictures,
    Readings,
    StoredPattern,
    length_between,
    of_images,
    of_session,
    read_field,
    stored_pattern,
)

SESSION, STRAIN = "session.h5", "strain.h5"
_AS_FILES = ("files:", "video:")


@dataclass(frozen=True, slots=True, eq=False)
class GaugeTrack:
    """A virtual gauge over a test.

    Attributes
    ----------
    value, sigma : (T,) float64
        Strain and its standard uncertainty; NaN where it was lost.
    described : mapping of str to JSON value
        Kind and position as configured; empty where the file has none.
    """

    value: NDArray[np.float64]
    sigma: NDArray[np.float64]
    described: dict[str, Any]


class RunFolder(Closing):
    """A finished run, open for reading; a context manager. ``open_run`` makes one.

    Attributes
    ----------
    path : Path
        The folder.
    strain : Strain
        Its results: maps and means.
    """

    def __init__(self, path: Path, strain: Strain) -> None:
        self.path, self.strain = path, strain
        self._sessions: list[Session] = []
        self._notes: dict[str, None] = {}  # in their order, each once
        self._patterns: dict[int, StoredPattern] = {}  # the last

    @cached_property
    def session(self) -> Session | None:
        """The recording, in this folder or the one that was replayed; None where there is none that can be read.

        The results do not depend on it; ``notes`` has why it cannot be read.
        """
        path = self.session_path
        if path is None:
            return None
        session: Session | None = None
        with self._recorded():
            session = Session.open(path)
            self._sessions.append(session)
        return session

    @property
    def notes(self) -> tuple[str, ...]:
        """What could not be read of the recording so far, a sentence each."""
        return tuple(self._notes)

    @contextmanager
    def _recorded(self) -> Iterator[None]:
        """Around the reading of a part of the recording: a note where it cannot be read."""
        try:
            yield
        except DataError as error:
            self._notes[Message("the recording cannot be read, the results can: {why}", error)] = None

    @cached_property
    def load_samples(self) -> list[LoadSample]:
        """The samples of the load cell; empty without a recording."""
        if self.session is not None:
            with self._recorded():
                return self.session.load_samples()
        return []

    @cached_property
    def readings(self) -> Readings:
        """Times in s since the start and forces in N of all load samples; none without a recording."""
        if self.session is not None:
            start, curves = self.session.start_monotonic, self.session.load_curves
            found = Readings(lambda: (Track(times - start, forces) for times, forces in curves()))
            with self._recorded():
                if found.count:
                    return found
        return Readings(lambda: iter(()))

    @property
    def load_curve(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The same at once, (N,) each: 16 bytes a sample."""
        pieces = [(np.empty(0), np.empty(0)), *((one.t, one.values) for one in self.readings.pieces())]
        times, forces = (np.concatenate(one) for one in zip(*pieces, strict=True))
        return times, forces

    @cached_property
    def frame_counts(self) -> dict[str, Any] | None:
        """The frame counts of the recording; None where there are none."""
        if self.session is not None:
            with self._recorded():
                return self.session.frame_counts
        return None

    @property
    def session_path(self) -> Path | None:
        """The file of the recording; None where there is none."""
        address = self.camera_address
        replayed = address.removeprefix("session:") if address.startswith("session:") else ""
        tried = [self.path / SESSION, *([Path(replayed), self.path / replayed] if replayed else [])]
        return next((path for path in tried if path.is_file()), None)

    @property
    def camera_address(self) -> str:
        """The address of the camera, as given."""
        return str(self.section("camera").get("address") or "")

    def section(self, name: str) -> dict[str, Any]:
        """A section of the configuration that was in force, as it is stored."""
        found = self.strain.config.get(name)
        return found if isinstance(found, dict) else {}

    @cached_property
    def pictures(self) -> Pictures | None:
        """Pictures of the measured instants; None where they cannot be found or read any more."""
        if self.session is not None:
            found: Pictures | None = None
            with self._recorded():
                found = of_session(self.session, self.strain)
            return found and replace(found, each=lambda rows: self._readable(found, rows))
        try:
            address = with_scheme(self.camera_address) if self.camera_address else ""
            return of_images(address, self.strain, self._crop) if address.startswith(_AS_FILES) else None
        except PhasedicError:
            return None

    @property
    def picture_size(self) -> tuple[int, int]:
        """Width and height of the pictures, px; where they are gone, the extent of the ZOIs with equal margins."""
        if self.pictures is not None:
            return self.pictures.info.width, self.pictures.info.height
        roi = self.strain.grid.roi
        return 2 * roi.x + roi.width, 2 * roi.y + roi.height

    def _readable(self, found: Pictures, rows: Sequence[int]) -> Iterator[Image | None]:
        """The picture of each row; None for one that is damaged."""
        for row in rows:
            picture = None
            with self._recorded():
                picture = next(iter(found.each([row])), None)
            yield picture

    @property
    def _crop(self) -> Crop | None:
        """The part of the pictures that was measured; None for all of it, or where the file has no valid one."""
        crop = self.section("camera").get("crop")
        if not isinstance(crop, list) or [type(value) for value in crop] != [int] * 4:
            return None
        x, y, width, height = crop
        return x, y, width, height

    @property
    def specimen(self) -> SpecimenConfig:
        """Section and axis of the load, as stored; keys that are not stored have their defaults.

        Raises
        ------
        DataError
            The file holds an impossible value.
        """
        known = {field.name for field in fields(SpecimenConfig)}
        stored = {key: value for key, value in self.section("specimen").items() if key in known}
        try:
            return from_dict({"specimen": stored}, {}, str(self.strain.path)).specimen
        except ConfigError as error:
            raise DataError("{why}; make the results again with phasedic replay", error) from None

    @property
    def mm_per_px(self) -> float | None:
        """The scale that was configured; None where there is none."""
        return self._number("scale", "mm_per_px") or None

    @property
    def stand_off_mm(self) -> float | None:
        """Distance from the camera to the specimen, mm; None where it was not configured."""
        return self._number("scale", "stand_off_mm") or None

    @property
    def readout_ms(self) -> float | None:
        """Time of the rolling shutter, ms, 0 without one; None where it was not configured."""
        return self._number("camera", "readout_ms")

    def _number(self, section: str, key: str) -> float | None:
        value = self.section(section).get(key)
        if isinstance(value, bool) or not isinstance(value, int | float) or not 0 <= value < math.inf:
            return None
        return float(value)

    @property
    def title(self) -> str:
        """Name of the specimen, else of the folder."""
        return str(self.strain.metadata.get("specimen") or self.path.resolve().name)

    @cached_property
    def load_axis(self) -> LoadAxis:
        """The axis of the load, as given or as found from the means."""
        names = ("exx", "eyy", "exy", "sigma_exx", "sigma_eyy")
        exx, eyy, exy, *sigmas = (np.asarray(self.strain.values[name], np.float64) for name in names)
        return load_axis(exx, eyy, exy, self.specimen.axis, np.fmax(*sigmas))

    @property
    def axial(self) -> str:
        """The strain along the load: "exx" or "eyy"."""
        return f"e{self.load_axis.axis * 2}"

    @property
    def transverse(self) -> str:
        """The strain across the load."""
        return "eyy" if self.load_axis.axis == "x" else "exx"

    @cached_property
    def gauges(self) -> dict[str, GaugeTrack]:
        """The virtual gauges by name, in the order of the configuration."""
        values, described = self.strain.values, self.section("gauges")
        names = [name.removeprefix("gauge_") for name in values if f"sigma_{name}" in values]
        names = [name for name in names if gauge_columns(name)[0] in values]
        tracks = {}
        for name in names:
            value, sigma = (np.asarray(values[column], np.float64) for column in gauge_columns(name)[:2])
            stored = described.get(name)
            keys = stored.items() if isinstance(stored, dict) else ()
            tracks[name] = GaugeTrack(value, sigma, {key: item for key, item in keys if item is not None})
        return tracks

    @property
    def axial_strain(self) -> NDArray[np.float64]:
        """Strain along the load, (T,): of the gauge ``axial`` where there is one, else of the region."""
        return self._known(strains_along(self.gauges, self.load_axis.axis)[0])

    @property
    def transverse_strain(self) -> NDArray[np.float64]:
        """Strain across the load, (T,): of the gauge ``transverse`` where there is one, else of the region."""
        return self._known(strains_along(self.gauges, self.load_axis.axis)[1])

    def _known(self, name: str) -> NDArray[np.float64]:
        found = self._strain(name)
        return np.full(self.strain.n, np.nan) if found is None else found

    def _strain(self, name: str) -> NDArray[np.float64] | None:
        if name in (AXIAL, TRANSVERSE):
            return self.gauges[name].value
        found = self.strain.values.get("blur_px" if name == "blur" else name)
        return None if found is None else np.asarray(found, np.float64)

    def field(self, row: int) -> StrainField:
        """The strain field of one instant, as ``strain.h5`` holds it.

        Raises
        ------
        DataError
            There is no such instant, or it cannot be read.
        """
        field, number = read_field(self.strain, row), self.strain.reference(row)
        if number is None:
            return field
        if number not in self._patterns:
            self._patterns = {number: stored_pattern(self.strain, number)}
        return replace(field, sums=self._patterns[number])

    @property
    def force(self) -> NDArray[np.float64]:
        """Force at each instant, (T,) N; NaN where it is not known."""
        return np.asarray(self.strain.values["force_N"], np.float64)

    @property
    def force_one_zero(self) -> NDArray[np.float64]:
        """The force as if the zero of the first instant had held to the end, (T,) N: no tare in mid-test."""
        return self.strain.force_one_zero

    @property
    def stress(self) -> NDArray[np.float64] | None:
        """Force over the section, (T,) Pa; None where the section is not known."""
        area = self.specimen.area_m2
        return None if area is None else self.force_one_zero / area

    @property
    def curve(self) -> Curve:
        """Stress over extension, for evaluation; force (N) where the section is not known."""
        load = self.force_one_zero if self.stress is None else self.stress
        times = np.asarray(self.strain.time_s, np.float64)
        return curve_of(self._strain, self.gauges, self.load_axis.axis, times, load)

    @property
    def gauge_length_mm(self) -> float | None:
        """Between the ends of the extension of the test; None without a scale, or where it has no ends."""
        described = self.gauges[AXIAL].described if AXIAL in self.gauges else None
        scale, length = self.mm_per_px, length_between(self.strain, self.load_axis.axis, described)
        return length * scale if scale and length > 0 else None

    @property
    def gauge_length(self) -> Figure | None:
        """The same with the uncertainty of the scale, mm."""
        length, sigma = self.gauge_length_mm, self._number("scale", "sigma_mm_per_px") or 0.0
        return Figure.about(length, length * sigma / self.mm_per_px) if length and self.mm_per_px else None

    @cached_property
    def events(self) -> list[Event]:
        """The recorded events without MEASURED, which comes with every burst; empty without a recording."""
        if self.session is not None:
            with self._recorded():
                return [one for one in self.session.events() if one.kind is not EventKind.MEASURED]
        return []

    @property
    def start_monotonic(self) -> float:
        """Time zero of the results on the clock of the recording's events, s."""
        return 0.0 if self.session is None else self.session.start_monotonic

    def __repr__(self) -> str:
        return f"<RunFolder {self.path}: {self.strain.n} instants>"

    def close(self) -> None:
        """Close the files; idempotent."""
        self.strain.close()
        for session in self._sessions:
            session.close()


def open_run(path: str | os.PathLike[str]) -> RunFolder:
    """Open the folder of a run, or a ``strain.h5`` in it; raises DataError where there is none that can be read."""
    path = Path(path)
    file = path / STRAIN if path.is_dir() else path
    if not file.exists():
        sides = [path / side for side in (*SIDES, *FIELDS) if (path / side / STRAIN).exists()]
        if sides:
            raise DataError(
                "{path}: a test with several cameras; give the folder of one, {one}", path, sides[0]
            )
        raise DataError(
            "{path}: no {file} there; give the folder that phasedic run or replay wrote", path, STRAIN
        )
    return RunFolder(file.parent, Strain.open(file))
