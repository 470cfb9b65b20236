"""Opening one session file for reading, whatever state it was left in.

A file whose writer was killed, or is still writing, opens only in SWMR mode; that is tried
by itself and said. Foreign, newer and truncated files are refused in words.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from acquire.clock import ClockPair
from acquire.closing import Closing
from acquire.errors import DataError, PhasedicError
from acquire.events import Event
from acquire.frame import Burst, CameraInfo, Frame, frozen
from acquire.hdf5 import check_size, probe, read_superblock, word
from acquire.load_sample import LoadCellInfo, LoadFlag, LoadSample
from acquire.record_mode import RecordMode
from acquire.session import layout
from acquire.session.bursts import read_burst

_STABLE = {code: word for word, code in layout.STABLE.items()}
# What HDF5, JSON and our own decoding raise on bytes that are not what they were.
DAMAGE = (
    OSError,
    RuntimeError,
    LookupError,
    ValueError,
    TypeError,
    AttributeError,
    MemoryError,
    OverflowError,
)
UNFINISHED = (
    "was not closed by its writer (killed, or still recording); everything complete in it is read."
    " 'phasedic recover' makes a clean copy"
)


class SessionPart(Closing):
    """One file of a session.

    Parameters
    ----------
    path : path
    probed : bool
        A child process has read it already, or this is the child.

    Raises
    ------
    DataError
        Not there, not readable, foreign, newer than this program, or damaged.
    """

    def __init__(self, path: str | os.PathLike[str], *, probed: bool = False) -> None:
        self.path = Path(path)
        self.file, self.recovered = _open_file(self.path, probed)
        try:
            self._read()
        except DAMAGE as error:
            self.file.close()
            raise damaged(self.path, "its description cannot be read", error) from error
        except PhasedicError as error:
            self.file.close()
            raise DataError(str(error)) from error

    def _read(self) -> None:
        _check_format(self.path, self.file.attrs)
        entry = self.file["entry"]
        self.entry: h5py.Group = entry
        self.config, self.metadata, self.versions = (
            _json(entry[name]) for name in ("config", "metadata", "versions")
        )
        self.camera: CameraInfo = layout.camera_from(_json(entry["instrument/camera/description"]))
        self.load_cell: LoadCellInfo | None = layout.load_from(
            _json(entry["instrument/load_cell/description"])
        )
        self.mode = _mode(entry.attrs)
        set_id = word(self.file.attrs["set_id"])
        self.set_id, self.part = "" if set_id == layout.NO_SET else set_id, int(self.file.attrs["part"])
        self.start = ClockPair.from_iso(float(entry["start_monotonic_s"][()]), word(entry["start_time"][()]))
        self.refresh()

    def refresh(self) -> None:
        """Look for what the writer has added since."""
        if self.recovered:
            for name in ("frames", "bursts", "load", "clock"):
                for dataset in self.entry[name].values():
                    dataset.id.refresh()
            self.entry["events"].id.refresh()
            self.entry["ledger"].id.refresh()
        self.columns = _table(self.entry["frames"], layout.FRAME_COLUMNS, "image")
        self.bursts = _table(self.entry["bursts"], layout.BURST_COLUMNS, "sum", "clipped")

    def __len__(self) -> int:
        return len(self.columns["index"])

    def frame(self, number: int) -> Frame:
        """The frame ``number``, 0 .. len - 1.

        Raises
        ------
        DataError
            Its bytes are damaged.
        """
        row = {name: column[number].item() for name, column in self.columns.items()}
        with _reading(self.path, f"frame {number} cannot be read"):
            image = self.entry["frames/image"][number]
        return Frame(
            image=frozen(image),
            index=row["index"],
            t=row["monotonic_s"],
            clock=layout.clock_word(row["clock"]),
            lost_before=row["lost_before"],
            bits=self.camera.bits,
            raw_t=row["raw_monotonic_s"],
            damaged=bool(row["damaged"]),
        )

    def burst(self, number: int) -> Burst:
        """The burst ``number`` that was recorded as such.

        Raises
        ------
        DataError
            Its bytes are damaged.
        """
        with _reading(self.path, f"burst {number} cannot be read"):
            return read_burst(self.entry["bursts"], self.bursts, number, self.camera.bits)

    def load_samples(self) -> list[LoadSample]:
        """All load samples with their raw lines."""
        with _reading(self.path, "the load samples cannot be read"):
            columns = _table(self.entry["load"], layout.LOAD_COLUMNS)
            lines = self.entry["load/lines"][:].tobytes()
        ends = columns["line_end"].tolist()
        starts = [0, *ends][: len(ends)]
        return [
            LoadSample(
                t=t,
                force=force,
                unit=unit.decode("ascii", "replace"),
                stable=_STABLE[stable],
                flags=LoadFlag(flags),
                raw=lines[start : end - 1],
                device_ms=None if np.isnan(device_ms) else device_ms,
            )
            for t, force, unit, stable, flags, device_ms, start, end in zip(
                *(columns[name].tolist() for name in _SAMPLE), starts, ends, strict=True
            )
            if end <= len(lines)
        ]

    def events(self) -> list[Event]:
        """All events."""
        with _reading(self.path, "the events cannot be read"):
            return layout.events_from(self.entry["events"][:])

    def clock_pairs(self) -> list[ClockPair]:
        """The pairs of clock readings."""
        with _reading(self.path, "the clock readings cannot be read"):
            columns = _table(self.entry["clock"], layout.CLOCK_COLUMNS)
            return [
                ClockPair.from_iso(float(t), utc.decode())
                for t, utc in zip(columns["monotonic_s"], columns["utc"].tolist(), strict=True)
            ]

    def ledger(self) -> dict[str, Any] | None:
        """The final counts; None where the writer did not come to its end."""
        with _reading(self.path, "the ledger cannot be read"):
            text = self.entry["ledger"][0]
            return json.loads(text) if text else None

    def walk_pictures(self) -> None:
        """Go through the index of all pictures, without reading them.

        Raises
        ------
        DataError
            It is damaged.
        """
        with _reading(self.path, "the index of the pictures cannot be read"):
            for name in ("frames/image", "bursts/sum", "bursts/clipped"):
                self.entry[name].id.get_num_chunks()

    def close(self) -> None:
        """Close the file; may be called again without effect."""
        self.file.close()


_SAMPLE = ("monotonic_s", "force", "unit", "stable", "flags", "device_ms")


class _reading:
    """Turns what HDF5 and the decoding of damaged bytes raise into a ``DataError``."""

    def __init__(self, path: Path, what: str) -> None:
        self._path, self._what = path, what

    def __enter__(self) -> None:
        pass

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: object) -> None:
        if isinstance(error, DAMAGE):
            raise damaged(self._path, self._what, error) from error


def damaged(path: Path, what: str, error: BaseException) -> DataError:
    """The error of a file whose bytes are not what they were."""
    reason = " ".join(str(error).split())[:160]
    return DataError(
        f"{path}: {what} ({reason}); the file is damaged: 'phasedic recover' saves what can be read"
    )


def _open_file(path: Path, probed: bool) -> tuple[h5py.File, str | None]:
    block = read_superblock(path)
    check_size(path, block)
    if block.unfinished and not probed:
        probe(path, "acquire.session")
    try:
        return h5py.File(path, "r", swmr=block.unfinished), UNFINISHED if block.unfinished else None
    except (OSError, RuntimeError) as error:
        raise damaged(path, "it cannot be opened", error) from error


def _check_format(path: Path, attributes: Mapping[str, Any]) -> None:
    if word(attributes.get("format", "")) != layout.FORMAT:
        raise DataError(f"{path} is an HDF5 file, but not a session of this program")
    version = int(attributes["format_version"])
    if version > layout.FORMAT_VERSION:
        raise DataError(
            f"{path} has format version {version}, this program reads up to {layout.FORMAT_VERSION};"
            " update phasedic"
        )


def _json(dataset: h5py.Dataset) -> Any:
    return json.loads(word(dataset[()]))


def _mode(attributes: Mapping[str, Any]) -> RecordMode:
    x, y, width, height = (int(value) for value in attributes["crop"])
    return RecordMode.parse(word(attributes["record"]), (x, y, width, height) if width else None)


def _table(group: h5py.Group, columns: layout.Columns, *also: str) -> dict[str, NDArray[Any]]:
    """The columns, cut to the rows that are complete in all of them and in the pictures ``also``."""
    n = min(group[name].shape[0] for name in (*columns, *also))
    table = {name: group[name][:n] for name in columns}
    missing = np.isnan(table["monotonic_s"])
    n = int(np.argmax(missing)) if missing.any() else n
    return {name: column[:n] for name, column in table.items()}
