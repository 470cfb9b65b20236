"""Where everything stands in a session file, and how it is encoded. Writer and reader share it.

The file is HDF5 in NeXus conventions (docs/session-format.md describes it for other programs).
All groups, datasets and attributes exist before the first frame, since a file in SWMR mode
can only grow. ``SessionInfo`` is what a session has once: devices, time zero, configuration, what is recorded.
"""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple, Self

import h5py
import numpy as np
from numpy.typing import NDArray

from acquire.clock import ClockPair
from acquire.events import Event
from acquire.frame import CameraInfo, Clock
from acquire.hdf5 import NO_UNIT, Declared, new_group, new_json, set_attributes, to_json
from acquire.load_sample import LoadCellInfo, LoadFlag
from acquire.record_mode import RecordMode
from acquire.text.message import kept

MAX_BURST_FRAMES = 65536


@dataclass(frozen=True, slots=True, eq=False)
class SessionInfo:
    """The description of a recording.

    Attributes
    ----------
    camera : CameraInfo
    load : LoadCellInfo or None
    start : ClockPair
        The start of the test; ``time_s`` counts from here.
    config, metadata, versions : mapping of str to JSON value
    mode : RecordMode
        Part of the picture; whether frames or bursts are what the file is for.
    burst_frames : int
        Frames of the longest burst that will be written.
    set_id, part : str, int
        Of a rotated recording (``RotatingWriter``).
    """

    camera: CameraInfo
    load: LoadCellInfo | None
    start: ClockPair
    config: Mapping[str, Any]
    metadata: Mapping[str, Any]
    versions: Mapping[str, Any]
    mode: RecordMode = dataclasses.field(default_factory=RecordMode)
    burst_frames: int = MAX_BURST_FRAMES
    set_id: str = ""
    part: int = 0

    def cropped(self) -> Self:
        """The same with the camera as it is recorded: the part ``mode.crop`` of its picture.

        Raises
        ------
        ConfigError
            That part leaves the picture.
        """
        if self.mode.crop is None:
            return self
        self.mode.check(self.camera.width, self.camera.height)
        _, _, width, height = self.mode.crop
        return dataclasses.replace(self, camera=dataclasses.replace(self.camera, width=width, height=height))


FORMAT = "phasedic-session"
FORMAT_VERSION = 1
NO_SET = "none"
NO_CROP = (0, 0, 0, 0)
EVENT_BYTES = 512  # of one row; longer events go on in rows that begin with CONTINUED
CONTINUED = b"+"
LEDGER_BYTES = 8192
CLOCKS: tuple[Clock, ...] = ("device", "host", "nominal")
STABLE = {None: -1, False: 0, True: 1}
ROWS = 512  # of a chunk of a one-dimensional dataset

_FIRST = ["0", ".", "."]
"""``default_slice`` of pictures: viewers begin with the first."""

MAX_TIME_S = 1e12  # no clock has gone so far
MAX_FORCE_N = 1e12
MAX_PIXELS = 1 << 28


class Column(NamedTuple):
    """A column of one value a row; ``missing`` is that of a row that is not written, the range that of others.

    ``later``: files of the first versions do not have it.
    """

    dtype: str
    missing: Any
    unit: str
    meaning: str
    low: float = -math.inf
    high: float = math.inf
    later: bool = False

    def declared(self) -> Declared:
        """What a reader demands of it."""
        return Declared(self.dtype, (None,), self.low, self.high)


def _time(meaning: str) -> Column:
    return Column("f8", np.nan, "s", meaning, -MAX_TIME_S, MAX_TIME_S)


def _count(meaning: str, high: float = math.inf, low: int = 0) -> Column:
    return Column("u4", 0, NO_UNIT, meaning, low, high)


def _sequence(meaning: str) -> Column:
    return Column("i8", -1, NO_UNIT, meaning, 0)


Columns = dict[str, Column]

FRAME_COLUMNS: Columns = {
    "time_s": _time("time since the start of the session, mid-exposure where known"),
    "monotonic_s": _time("the same on the machine's monotonic clock"),
    "raw_monotonic_s": _time("the stamp as it came, monotonic clock"),
    "index": _sequence("sequence number of the source"),
    "lost_before": _count("frames known to be lost since the frame before"),
    "damaged": Column("u1", 0, NO_UNIT, "1: the device said that the content is not whole", 0, 1),
    "clock": Column("u1", 0, NO_UNIT, "who stamped: 0 device, 1 host, 2 nobody (a given rate)", 0, 2),
}
LOAD_COLUMNS: Columns = {
    "time_s": _time("time since the start of the session"),
    "monotonic_s": _time("the same on the machine's monotonic clock"),
    "force": Column(
        "f8",
        np.nan,
        "N",
        "tension positive; NaN where the line gave no valid value",
        -MAX_FORCE_N,
        MAX_FORCE_N,
    ),
    "flags": _count("bits: see flag_names", sum(flag.value for flag in LoadFlag)),
    "stable": Column("i1", -1, NO_UNIT, "1 yes, 0 no, -1 not said", -1, 1),
    "device_ms": Column("f8", np.nan, "ms", "the device's own time, where it sends one"),
    "unit": Column("S8", b"", NO_UNIT, "unit on the line, or as the user said"),
    "line_end": Column("u8", 0, NO_UNIT, "where in lines the line of this sample ends", 1),
}
BURST_COLUMNS: Columns = {
    "time_s": _time("mean time of the frames, since the start of the session"),
    "monotonic_s": _time("the same on the machine's monotonic clock"),
    "n": _count("frames summed", MAX_BURST_FRAMES, 1),
    "noise": Column("f8", np.nan, "GL", "temporal standard deviation of one frame", 0, 65535),
    "duration": _time("time from the first frame to the last"),
    "first_index": _sequence("sequence number of the first frame"),
    "last_index": _sequence("sequence number of the last frame"),
    "lost": _count("frames lost or left out since the burst before"),
    "blank": Column(
        "u4",
        0,
        NO_UNIT,
        "which of its frames, from 1, has less than half the contrast of another; 0: none",
        0,
        MAX_BURST_FRAMES,
        later=True,
    ),
    "clock": Column("u1", 0, NO_UNIT, "who stamped: 0 device, 1 host, 2 nobody (a given rate)", 0, 2),
}
CLOCK_COLUMNS: Columns = {
    "monotonic_s": _time("monotonic clock"),
    "utc": Column("S27", b"", NO_UNIT, "the same instant in UTC, ISO 8601"),
}


def image_dtype(bits: int) -> np.dtype[Any]:
    """uint8 up to 8 significant bits, else uint16."""
    return np.dtype(np.uint8 if bits <= 8 else np.uint16)


def new_columns(group: h5py.Group, columns: Columns, checksum: bool) -> None:
    """Empty one-dimensional datasets that can grow, each with its unit and meaning."""
    for name, c in columns.items():
        dataset = group.create_dataset(
            name, (0,), c.dtype, maxshape=(None,), chunks=(ROWS,), fillvalue=c.missing, fletcher32=checksum
        )
        set_attributes(dataset, units=c.unit, long_name=c.meaning)


def new_images(group: h5py.Group, name: str, shape: tuple[int, ...], dtype: Any, checksum: bool) -> None:
    """An empty stack of pictures; one chunk holds exactly one of them."""
    dataset = group.create_dataset(
        name, (0, *shape), dtype, maxshape=(None, *shape), chunks=(1, *shape), fletcher32=checksum
    )
    set_attributes(dataset, units="GL")


def describe_camera(info: CameraInfo) -> dict[str, Any]:
    """``CameraInfo`` as JSON values."""
    names = ("address", "name", "width", "height", "bits", "live", "clock", "fps", "exposure_s")
    return {
        name: getattr(info, name) for name in (*names, "pixel_format", "controls", "warnings", "white_level")
    }


def describe_load(info: LoadCellInfo | None) -> dict[str, Any] | None:
    """``LoadCellInfo`` as JSON values."""
    if info is None:
        return None
    names = ("address", "name", "protocol", "clock", "sign", "capacity_N", "settings", "warnings")
    return {name: getattr(info, name) for name in names}


def create(file: h5py.File, about: SessionInfo, checksum: bool) -> None:
    """Everything that will ever stand in the file, empty."""
    set_attributes(file, NX_class="NXroot", default="entry", format=FORMAT, format_version=FORMAT_VERSION)
    set_attributes(file, set_id=about.set_id or NO_SET, part=about.part)
    shown = "bursts" if about.mode.kind == "bursts" else "frames"
    entry = new_group(file, "entry", "NXentry", default=shown)
    set_attributes(entry, record=about.mode.text(), crop=np.array(about.mode.crop or NO_CROP, np.int64))
    set_attributes(
        entry.create_dataset("start_time", data=np.bytes_(about.start.iso())), units="ISO 8601 UTC"
    )
    set_attributes(entry.create_dataset("start_monotonic_s", data=about.start.monotonic), units="s")
    for name in ("config", "metadata", "versions"):
        new_json(entry, name, getattr(about, name))
    instrument = new_group(entry, "instrument", "NXinstrument")
    new_json(new_group(instrument, "camera", "NXdetector"), "description", describe_camera(about.camera))
    new_json(new_group(instrument, "load_cell", "NXsensor"), "description", describe_load(about.load))
    _create_frames(entry, about.camera, checksum)
    _create_bursts(entry, about.camera, about.burst_frames, checksum)
    _create_load(entry, checksum)
    new_columns(new_group(entry, "clock", "NXcollection"), CLOCK_COLUMNS, checksum)
    entry.create_dataset(
        "events", (0,), f"S{EVENT_BYTES}", maxshape=(None,), chunks=(16,), fletcher32=checksum
    )
    entry.create_dataset("ledger", (1,), f"S{LEDGER_BYTES}")
    set_attributes(entry["events"], units=NO_UNIT)
    set_attributes(entry["ledger"], units=NO_UNIT)


def _add_title(group: h5py.Group, words: str) -> None:
    """As a dataset of fixed length and UTF-8: viewers show what is marked as ASCII as bytes."""
    data = np.array(words.encode(), h5py.string_dtype("utf-8", len(words)))
    set_attributes(group.create_dataset("title", data=data), units=NO_UNIT)


def _create_frames(entry: h5py.Group, camera: CameraInfo, checksum: bool) -> None:
    axes = ["time_s", ".", "."]
    frames = new_group(entry, "frames", "NXdata", signal="image", axes=axes, time_s_indices=0)
    set_attributes(frames, default_slice=_FIRST)
    _add_title(frames, "Frames as they were grabbed")
    new_columns(frames, FRAME_COLUMNS, checksum)
    new_images(frames, "image", (camera.height, camera.width), image_dtype(camera.bits), checksum)
    set_attributes(frames["image"], bits=camera.bits)


def _create_bursts(entry: h5py.Group, camera: CameraInfo, frames: int, checksum: bool) -> None:
    axes = ["time_s", ".", "."]
    bursts = new_group(entry, "bursts", "NXdata", signal="sum", axes=axes, time_s_indices=0)
    set_attributes(bursts, default_slice=_FIRST)
    _add_title(bursts, "Sums of bursts")
    new_columns(bursts, BURST_COLUMNS, checksum)
    size = (camera.height, camera.width)
    dtype = np.uint16 if (2**camera.bits - 1) * frames < 2**16 else np.uint32
    new_images(bursts, "sum", size, dtype, checksum)
    set_attributes(bursts["sum"], long_name="sum of the n frames; the mean is sum / n")
    packed = (camera.height * camera.width + 7) // 8
    clipped = bursts.create_dataset(
        "clipped", (0, packed), "u1", maxshape=(None, packed), chunks=(1, packed), compression="gzip",
        compression_opts=1, fletcher32=checksum,
    )  # fmt: skip
    meaning = "pixels at saturation in any frame: one bit each, rows end to end, high bit first"
    set_attributes(clipped, units=NO_UNIT, long_name=meaning)


def _create_load(entry: h5py.Group, checksum: bool) -> None:
    load = new_group(entry, "load", "NXdata", signal="force", axes=["time_s"], time_s_indices=0)
    _add_title(load, "Force")
    new_columns(load, LOAD_COLUMNS, checksum)
    set_attributes(load["flags"], flag_names=json.dumps({flag.name: flag.value for flag in LoadFlag}))
    lines = load.create_dataset("lines", (0,), "u1", maxshape=(None,), chunks=(8192,), fletcher32=checksum)
    meaning = "the bytes of the lines, one after the other, each ended by a line feed"
    set_attributes(lines, units=NO_UNIT, long_name=meaning)


def event_rows(event: Event, start: float) -> NDArray[np.bytes_]:
    """An event as rows of the events dataset: (n,) of EVENT_BYTES each."""
    texts = {"kind": event.kind.value, "level": event.level, "source": event.source, **kept(event.text)}
    stamped = {"time_s": event.t - start, "monotonic_s": event.t, **texts, "data": event.data}
    text = to_json(stamped).encode("ascii")
    rows = [text[:EVENT_BYTES]]
    step = EVENT_BYTES - len(CONTINUED)
    rows += [CONTINUED + text[i : i + step] for i in range(EVENT_BYTES, len(text), step)]
    return np.array(rows, f"S{EVENT_BYTES}")
