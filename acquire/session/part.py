"""Opening one session file for reading, whatever state it was left in.

A file whose writer was killed, or is still writing, opens only in SWMR mode; that is tried
automatically and reported. Foreign, newer and truncated files are refused in words.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from acquire import hdf5
from acquire.clock import ClockPair
from acquire.errors import DataError, PhasedicError
from acquire.events import Event
from acquire.frame import Burst, CameraInfo, Frame, frozen
from acquire.load_sample import LoadCellInfo, LoadSample
from acquire.opening import Closing
from acquire.record_mode import RecordMode
from acquire.session import layout, stored
from acquire.session.rows import LoadPiece, LoadTable, burst_from
from acquire.session.stored import events_from, read_column, read_rows
from acquire.text import Message, about

UNFINISHED = Message(
    "was not closed by its writer (killed, or still recording); everything complete in it is read. "
    "'phasedic recover' makes a clean copy"
)

ADVICE = Message("; the file is damaged: 'phasedic recover' saves what can be read")
NOTHING = Message("; the file is damaged, and nothing of it can be saved")


class SessionPart(Closing):
    """One file of a session.

    Parameters
    ----------
    path : path
    probed : bool
        A child process has read it already, or this is the child.
    salvage : bool
        What is missing or beyond sense in the tables is left out, not refused.

    Attributes
    ----------
    troubles : tuple of str
        What is odd about its content, for a person.

    Raises
    ------
    DataError
        Not there, not readable, foreign, newer than this program, damaged, or not as ``layout`` declares.
    """

    def __init__(self, path: str | os.PathLike[str], *, probed: bool = False, salvage: bool = False) -> None:
        self.path = Path(path)
        self.file, self.recovered = _open_file(self.path, probed, salvage)
        self._salvage, self._advice = salvage, "" if salvage else ADVICE
        self._whole = self.recovered is None and not salvage
        self._follows = self.recovered == UNFINISHED
        try:
            self._read()
        except hdf5.DAMAGE as error:
            self.file.close()
            what = Message("its description cannot be read")
            raise damaged(self.path, what, error, self._advice or NOTHING) from error
        except PhasedicError as error:
            self.file.close()
            raise DataError(error.text) from error

    def _read(self) -> None:
        hdf5.check_format(self.path, self.file, layout.ROOT, layout.FORMAT, layout.FORMAT_VERSION)
        root = hdf5.read_attributes(self.file, layout.ROOT)
        hdf5.check_links(self.file)
        entry = self.entry = hdf5.open_group(self.file, "entry")
        held = _values(entry, layout.ENTRY)
        self.config = stored.config_from(held["config"], Message("{path}: config", self.path))
        self.metadata, self.versions = (
            hdf5.read_object(held[name], about(self.path, name)) for name in ("metadata", "versions")
        )
        instrument = hdf5.open_group(entry, "instrument")
        camera, cell = (
            _values(hdf5.open_group(instrument, name), items)["description"]
            for name, items in (("camera", layout.CAMERA), ("load_cell", layout.LOAD_CELL))
        )
        self.camera: CameraInfo = stored.camera_from(camera, Message("{path}: the camera", self.path))
        self.load_cell: LoadCellInfo | None = stored.load_from(
            cell, Message("{path}: the load cell", self.path)
        )
        self._form = layout.groups(self.camera)
        self.mode = _mode(hdf5.read_attributes(entry, layout.OF_ENTRY))
        set_id = hdf5.as_text(root["set_id"])
        self.set_id, self.part = "" if set_id == layout.NO_SET else set_id, int(root["part"])
        self.start = ClockPair.from_iso(float(held["start_monotonic_s"]), hdf5.as_text(held["start_time"]))
        self._groups = {name: hdf5.open_group(entry, name) for name in ("frames", "bursts", "load", "clock")}
        self.refresh()

    def refresh(self) -> None:
        """Look for what the writer has added since."""
        self._open_the_growing()
        frames, bursts = self._groups["frames"], self._groups["bursts"]
        how = {"whole": self._whole, "closed": not self._follows}
        self._frames = read_rows(frames, layout.FRAME_COLUMNS, [self._images], **how)
        self._bursts = read_rows(bursts, layout.BURST_COLUMNS, [self._sums, self._clipped], **how)
        self.columns, self.bursts = self._frames.columns, self._bursts.columns
        self._check_order()
        self.troubles = (*self._frames.troubles, *self._bursts.troubles, *self._troubles_of_the_load())

    def _open_the_growing(self) -> None:
        if self._follows:
            for group in self._groups.values():
                for dataset in group.values():
                    dataset.id.refresh()
            for name in ("events", "ledger"):
                self.entry[name].id.refresh()
        self._images, self._sums, self._clipped, lines = (
            hdf5.open_dataset(self._groups[group], name, self._form[group].items[name])
            for group, name in (
                ("frames", "image"),
                ("bursts", "sum"),
                ("bursts", "clipped"),
                ("load", "lines"),
            )
        )
        self._pictures = hdf5.PictureReader(self._images)
        self._loads = LoadTable(self._groups["load"], lines, whole=self._whole, closed=not self._follows)
        self._events, self._frame_counts = hdf5.open_datasets(self.entry, layout.NOTES).values()

    def _check_order(self) -> None:
        """Frames are found by their sequence numbers."""
        for name, numbers in (("frames", self.columns["index"]), ("bursts", self.bursts["first_index"])):
            if self._whole and np.any(wrong := np.diff(numbers) <= 0):
                row = int(np.argmax(wrong)) + 1
                raise DataError(
                    "{path}: the sequence numbers of {name} do not increase at row {row}; the file is damaged: "
                    "'phasedic recover' copies what can be read",
                    self.path,
                    name,
                    row,
                )

    def _troubles_of_the_load(self) -> tuple[str, ...]:
        try:
            return self._loads.troubles()
        except (*hdf5.DAMAGE, DataError):
            return ()  # load_samples() raises

    def __len__(self) -> int:
        return len(self._frames)

    def frame(self, number: int) -> Frame:
        """The frame ``number``, 0 .. len - 1.

        Raises
        ------
        DataError
            Its bytes are damaged.
        """
        row = {name: column[number].item() for name, column in self.columns.items()}
        with _reading(self.path, Message("frame {number} cannot be read", number), self._advice):
            image = self._pictures[int(self._frames.places[number])]
            if self._salvage and not image.any():  # the checksum of zeros is zero
                raise ValueError("all bytes are zero")
        return Frame(
            image=frozen(image),
            index=row["index"],
            t=row["monotonic_s"],
            clock=layout.CLOCKS[row["clock"]],
            lost_before=row["lost_before"],
            bits=self.camera.bits,
            raw_t=row["raw_monotonic_s"],
            damaged=bool(row["damaged"]),
            white_level=self.camera.white_level,
        )

    def burst(self, number: int) -> Burst:
        """The burst ``number`` that was recorded as such.

        Raises
        ------
        DataError
            Its bytes are damaged.
        """
        with _reading(self.path, Message("burst {number} cannot be read", number), self._advice):
            place = int(self._bursts.places[number])
            row = {name: column[number].item() for name, column in self.bursts.items()}
            return burst_from(self._sums[place], self._clipped[place], row, self.camera.bits)

    def load_pieces(self, low: float = -math.inf, high: float = math.inf) -> Iterator[LoadPiece]:
        """The load samples from ``low`` to ``high`` (monotonic s), by the piece; raises DataError."""
        with _reading(self.path, Message("the load samples cannot be read"), self._advice):
            yield from self._loads.pieces(low, high)

    def load_samples(self) -> list[LoadSample]:
        """All load samples with their raw lines; 280 bytes of memory each."""
        return [sample for piece in self.load_pieces() for sample in piece.samples()]

    def load_curves(self) -> Iterator[tuple[NDArray[np.float64], NDArray[np.float64]]]:
        """Times (N,) in monotonic s and forces (N,) in N of all load samples, by the piece; raises DataError."""
        with _reading(self.path, Message("the load samples cannot be read"), self._advice):
            yield from self._loads.curve()

    def events(self) -> list[Event]:
        """All events."""
        with _reading(self.path, Message("the events cannot be read"), self._advice):
            rows = read_column(self._events, whole=self._whole)
            return events_from(rows, str(self.path), whole=self._whole)

    def clock_pairs(self) -> list[ClockPair]:
        """The pairs of clock readings."""
        with _reading(self.path, Message("the clock readings cannot be read"), self._advice):
            columns = read_rows(self._groups["clock"], layout.CLOCK_COLUMNS, whole=self._whole).columns
            return [
                ClockPair.from_iso(float(t), utc.decode())
                for t, utc in zip(columns["monotonic_s"], columns["utc"].tolist(), strict=True)
            ]

    def frame_counts(self) -> dict[str, Any] | None:
        """The final counts; None where the writer did not come to its end."""
        with _reading(self.path, Message("the ledger cannot be read"), self._advice):
            return stored.ledger_from(self._frame_counts[0], Message("{path}: the ledger", self.path))

    def walk_pictures(self) -> None:
        """Go through the index of all pictures, without reading them.

        Raises
        ------
        DataError
            It is damaged.
        """
        with _reading(self.path, Message("the index of the pictures cannot be read"), self._advice):
            for pictures in (self._images, self._sums, self._clipped):
                pictures.id.get_num_chunks()
                hdf5.still_reading()

    def close(self) -> None:
        """Close the file; idempotent."""
        self.file.close()


class _reading:
    """Turns what HDF5 and the decoding of damaged bytes raise into a ``DataError``."""

    def __init__(self, path: Path, what: str, advice: str) -> None:
        self._path, self._what, self._advice = path, what, advice

    def __enter__(self) -> None:
        pass

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: object) -> None:
        if isinstance(error, hdf5.DAMAGE):
            raise damaged(self._path, self._what, error, self._advice) from error


def damaged(path: Path, what: str, error: BaseException, advice: str = ADVICE) -> DataError:
    """The error of a file whose bytes are not what they were."""
    reason = " ".join(str(error).split())[:160]
    return DataError("{path}: {what} ({reason}){advice}", path, what, reason, advice)


def _open_file(path: Path, probed: bool, salvage: bool) -> tuple[h5py.File, str | None]:
    block = hdf5.read_superblock(path)
    there = path.stat().st_size
    is_cut = not block.unfinished and there < block.size
    if is_cut and not salvage:
        try:
            hdf5.check_size(path, block)
        except DataError as error:
            raise DataError("{error}, or save what is there with 'phasedic recover'", error) from None
    if (block.unfinished or is_cut) and not probed:
        hdf5.probe(path, "acquire.session", words=["salvage"] if salvage else [])
    try:
        if is_cut:
            return h5py.File(hdf5.PaddedFile(path, block.size), "r"), Message(
                "is truncated: {there} of {size} bytes are there", there, block.size
            )
        return hdf5.open_file(path, swmr=block.unfinished), UNFINISHED if block.unfinished else None
    except (OSError, RuntimeError) as error:
        raise damaged(path, Message("it cannot be opened"), error, NOTHING if salvage else ADVICE) from error


def _values(group: h5py.Group, items: Mapping[str, hdf5.Declared]) -> dict[str, Any]:
    return {
        name: hdf5.read_scalar(item, items[name]) for name, item in hdf5.open_datasets(group, items).items()
    }


def _mode(attributes: Mapping[str, Any]) -> RecordMode:
    x, y, width, height = (int(value) for value in attributes["crop"])
    return RecordMode.parse(hdf5.as_text(attributes["record"]), (x, y, width, height) if width else None)
