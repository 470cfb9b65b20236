"""Where everything stands in a session file, and how it is encoded. Writer, reader and documents share it.

The file is HDF5 in NeXus conventions (docs/session-format.md describes it for other programs). A file from elsewhere is
believed where it is as declared here, and nowhere else.
All groups, datasets and attributes exist before the first frame, since a file in SWMR mode
can only grow. ``SessionInfo`` is what a session has once: devices, time zero, configuration, what is recorded.
"""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self, get_args

import h5py
import numpy as np
from numpy.typing import NDArray

from acquire.clock import ClockPair
from acquire.events import Event, Level
from acquire.frame import CameraInfo, ClockKind
from acquire.hdf5 import NO_UNIT, Declared, Group, JsonField, new_datasets, new_group, set_attributes, to_json
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
CLOCKS: tuple[ClockKind, ...] = ("device", "host", "nominal")
STABLE = {None: -1, False: 0, True: 1}
FLAGS = {flag.name: flag.value for flag in LoadFlag}

MAX_TIME_S = 1e12  # no clock has gone so far
MAX_FORCE_N = 1e12
MAX_PIXELS = 1 << 28


def _time(meaning: str) -> Declared:
    return Declared("f8", (None,), -MAX_TIME_S, MAX_TIME_S, "s", meaning, missing=np.nan)


def _count(meaning: str, high: float = math.inf, low: int = 0, *, later: bool = False) -> Declared:
    return Declared("u4", (None,), low, high, NO_UNIT, meaning, missing=0, later=later)


def _sequence(meaning: str) -> Declared:
    return Declared("i8", (None,), 0, math.inf, NO_UNIT, meaning, missing=-1)


def _word(dtype: str, meaning: str, low: float, high: float, missing: int = 0) -> Declared:
    return Declared(dtype, (None,), low, high, NO_UNIT, meaning, missing=missing)


def _text(size: int, meaning: str) -> Declared:
    return Declared(f"S{size}", (None,), unit=NO_UNIT, long_name=meaning, missing=b"")


def _json(words: str) -> Declared:
    return Declared("S", unit=NO_UNIT, words=f"JSON: {words}")


FRAME_COLUMNS = {
    "time_s": _time("time since the start of the session, mid-exposure where known"),
    "monotonic_s": _time("the same on the machine's monotonic clock"),
    "raw_monotonic_s": _time("the stamp as it came, monotonic clock"),
    "index": _sequence("sequence number of the source"),
    "lost_before": _count("frames known to be lost since the frame before"),
    "damaged": _word("u1", "1: the device said that the content is not whole", 0, 1),
    "clock": _word("u1", "who stamped: 0 device, 1 host, 2 nobody (a given rate)", 0, 2),
}
LOAD_COLUMNS = {
    "time_s": _time("time since the start of the session"),
    "monotonic_s": _time("the same on the machine's monotonic clock"),
    "force": Declared(
        "f8", (None,), -MAX_FORCE_N, MAX_FORCE_N, "N", "tension positive; NaN where the line gave no valid value",
        missing=np.nan,
    ),
    "flags": Declared(
        "u4", (None,), 0, sum(FLAGS.values()), NO_UNIT, "bits: see flag_names", missing=0,
        more={"flag_names": json.dumps(FLAGS)},
    ),
    "stable": _word("i1", "1 yes, 0 no, -1 not said", -1, 1, -1),
    "device_ms": Declared(
        "f8", (None,), unit="ms", long_name="the device's own time, where it sends one", missing=np.nan
    ),
    "unit": _text(8, "unit on the line, or as the user said"),
    "line_end": _word("u8", "where in lines the line of this sample ends", 1, math.inf),
}  # fmt: skip
BURST_COLUMNS = {
    "time_s": _time("mean time of the frames, since the start of the session"),
    "monotonic_s": _time("the same on the machine's monotonic clock"),
    "n": _count("frames summed", MAX_BURST_FRAMES, 1),
    "noise": Declared(
        "f8", (None,), 0, 65535, "GL", "temporal standard deviation of one frame", missing=np.nan
    ),
    "duration": _time("time from the first frame to the last"),
    "first_index": _sequence("sequence number of the first frame"),
    "last_index": _sequence("sequence number of the last frame"),
    "lost": _count("frames lost or left out since the burst before"),
    "blank": _count(
        "which of its frames, from 1, has less than half the contrast of another; 0: none",
        MAX_BURST_FRAMES,
        later=True,
    ),
    "clock": _word("u1", "who stamped: 0 device, 1 host, 2 nobody (a given rate)", 0, 2),
}
CLOCK_COLUMNS = {
    "monotonic_s": _time("monotonic clock"),
    "utc": _text(27, "the same instant in UTC, ISO 8601"),
}
ROOT = {
    "format": Declared("S"), "format_version": Declared("int", (), 1), "set_id": Declared("S"),
    "part": Declared("int", (), 0, 999_999),
}  # fmt: skip
OF_ENTRY = {"record": Declared("S"), "crop": Declared("i8", (4,), 0, 65_535)}
"""Attributes of the root and of ``entry``."""
ENTRY = {
    "start_time": Declared("S", unit="ISO 8601 UTC", words="start of the test, UTC"),
    "start_monotonic_s": Declared(
        "f8", (), -MAX_TIME_S, MAX_TIME_S, "s",
        words="the same instant on the monotonic clock of the recording machine",
    ),
    "config": _json("configuration in force"),
    "metadata": _json("free text of the user"),
    "versions": _json("versions of the software"),
}  # fmt: skip
NOTES = {
    "events": Declared(
        f"S{EVENT_BYTES}", (None,), unit=NO_UNIT, rows=16,
        words="one JSON object a row; a row that begins with `+` continues the row before",
    ),
    "ledger": Declared(
        f"S{LEDGER_BYTES}", (1,), unit=NO_UNIT,
        words="JSON: final frame counts; empty where the run did not come to its end",
    ),
}  # fmt: skip
CAMERA = {"description": _json("identity, format and controls in force")}
LOAD_CELL = {"description": _json("identity, settings, sign and calibration; null without one")}
_CLOCK = JsonField(str, words=CLOCKS)
CAMERA_FIELDS = {
    "address": JsonField(str), "name": JsonField(str),
    "width": JsonField(int, 1, 65_535), "height": JsonField(int, 1, 65_535), "bits": JsonField(int, 1, 16),
    "live": JsonField(bool), "clock": _CLOCK,
    "fps": JsonField(float, 0, 1e9, missing=True), "exposure_s": JsonField(float, 0, 1e9, missing=True),
    "pixel_format": JsonField(str), "controls": JsonField(dict), "warnings": JsonField(list),
    "white_level": JsonField(int, 1, 65_535, missing=True),
}  # fmt: skip
LOAD_FIELDS = {
    "address": JsonField(str), "name": JsonField(str), "protocol": JsonField(str), "clock": _CLOCK,
    "sign": JsonField(int, -1, 1), "capacity_N": JsonField(float, 0, MAX_FORCE_N, missing=True),
    "settings": JsonField(dict), "warnings": JsonField(list),
}  # fmt: skip
EVENT_FIELDS = {
    "monotonic_s": JsonField(float, -MAX_TIME_S, MAX_TIME_S),
    "kind": JsonField(str), "source": JsonField(str), "text": JsonField(str),
    "level": JsonField(str, words=get_args(Level)), "data": JsonField(dict),
}  # fmt: skip
_FRAME = JsonField(int, 0, 2**63 - 1)
BURST_FIELDS = {"first": _FRAME, "last": _FRAME, "n": JsonField(int, 1, MAX_BURST_FRAMES)}
"""JSON of the camera, of the load cell, of an event, and of the data of one that names a burst."""


def image_dtype(bits: int) -> np.dtype[Any]:
    """uint8 up to 8 significant bits, else uint16."""
    return np.dtype(np.uint8 if bits <= 8 else np.uint16)


def groups(camera: CameraInfo, sums: str = "u2 u4") -> dict[str, Group]:
    """The groups of ``entry`` in a file of pictures of ``camera``, with the type of the sums of bursts."""
    size, packed = (None, camera.height, camera.width), (camera.height * camera.width + 7) // 8
    of_pictures = {"axes": ["time_s", ".", "."], "time_s_indices": 0, "default_slice": ["0", ".", "."]}
    image = Declared(
        image_dtype(camera.bits).str, size, unit="GL", rows=1, more={"bits": camera.bits},
        words="grey levels as grabbed; the attribute `bits` has the significant bits",
    )  # fmt: skip
    total = Declared(sums, size, unit="GL", long_name="sum of the n frames; the mean is sum / n", rows=1)
    clipped = Declared(
        "u1", (None, packed), unit=NO_UNIT, rows=1, packed={"compression": "gzip", "compression_opts": 1},
        long_name="pixels at saturation in any frame: one bit each, rows end to end, high bit first",
    )  # fmt: skip
    lines = Declared(
        "u1", (None,), unit=NO_UNIT, rows=8192,
        long_name="the bytes of the lines, one after the other, each ended by a line feed",
    )  # fmt: skip
    frames, bursts = FRAME_COLUMNS | {"image": image}, BURST_COLUMNS | {"sum": total, "clipped": clipped}
    of_load = {"signal": "force", "axes": ["time_s"], "time_s_indices": 0}
    return {
        "frames": Group("NXdata", frames, of_pictures | {"signal": "image"}, "Frames as they were grabbed"),
        "bursts": Group("NXdata", bursts, of_pictures | {"signal": "sum"}, "Sums of bursts"),
        "load": Group("NXdata", LOAD_COLUMNS | {"lines": lines}, of_load, "Force"),
        "clock": Group("NXcollection", CLOCK_COLUMNS),
        "instrument": Group("NXinstrument"),
        "instrument/camera": Group("NXdetector", CAMERA),
        "instrument/load_cell": Group("NXsensor", LOAD_CELL),
    }


def describe_camera(info: CameraInfo) -> dict[str, Any]:
    """``CameraInfo`` as JSON values."""
    return {name: getattr(info, name) for name in CAMERA_FIELDS}


def describe_load(info: LoadCellInfo | None) -> dict[str, Any] | None:
    """``LoadCellInfo`` as JSON values."""
    return None if info is None else {name: getattr(info, name) for name in LOAD_FIELDS}


def create(file: h5py.File, about: SessionInfo, checksum: bool) -> None:
    """Everything that will ever stand in the file, empty."""
    camera, mode = about.camera, about.mode
    set_attributes(file, NX_class="NXroot", default="entry", format=FORMAT, format_version=FORMAT_VERSION)
    set_attributes(file, set_id=about.set_id or NO_SET, part=about.part)
    entry = new_group(file, "entry", "NXentry", default="bursts" if mode.kind == "bursts" else "frames")
    set_attributes(entry, record=mode.text(), crop=np.array(mode.crop or NO_CROP, np.int64))
    values = {"start_time": np.bytes_(about.start.iso()), "start_monotonic_s": about.start.monotonic}
    values |= {name: _stored_json(getattr(about, name)) for name in ("config", "metadata", "versions")}
    new_datasets(entry, ENTRY | NOTES, values, checksum=checksum)
    sums = "u2" if (2**camera.bits - 1) * about.burst_frames < 2**16 else "u4"
    descriptions = {"camera": describe_camera(camera), "load_cell": describe_load(about.load)}
    for name, form in groups(camera, sums).items():
        group = new_group(entry, name, form.nexus, **form.attributes)
        described = {"description": _stored_json(descriptions.get(name.rpartition("/")[2]))}
        new_datasets(group, form.items, described, checksum=checksum)
        if form.title:
            # As a dataset of fixed length and UTF-8: viewers show what is marked as ASCII as bytes.
            data = np.array(form.title.encode(), h5py.string_dtype("utf-8", len(form.title)))
            set_attributes(group.create_dataset("title", data=data), units=NO_UNIT)


def _stored_json(value: Any) -> np.bytes_:
    return np.bytes_(to_json(value))


def event_rows(event: Event, start: float) -> NDArray[np.bytes_]:
    """An event as rows of the events dataset: (n,) of EVENT_BYTES each."""
    texts = {"kind": event.kind.value, "level": event.level, "source": event.source, **kept(event.text)}
    stamped = {"time_s": event.t - start, "monotonic_s": event.t, **texts, "data": event.data}
    text = to_json(stamped).encode("ascii")
    rows = [text[:EVENT_BYTES]]
    step = EVENT_BYTES - len(CONTINUED)
    rows += [CONTINUED + text[i : i + step] for i in range(EVENT_BYTES, len(text), step)]
    return np.array(rows, f"S{EVENT_BYTES}")
