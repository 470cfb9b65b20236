"""Pictures in an HDF5 file, one chunk each, appended and read past the library's own filter.

HDF5 computes its Fletcher-32 byte by byte: most of the time of a frame that is recorded or read. Here the chunk is
made whole by our own code, to the same bytes, and handed over as it will stand in the file; and read as it stands.
"""

from __future__ import annotations

import contextlib
import sys
import zlib
from functools import cache
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

COMPRESSED: dict[str, Any] = {"compression": "gzip", "compression_opts": 1, "shuffle": True}
"""For ``create_dataset``: what ``PictureStack`` then does itself, outside the library's lock."""

_WORTH_NUMBA = 400  # pictures read, after which loading numba pays where it is not loaded yet


@cache
def compile_loops() -> None:
    """Have the compiled checksum ready (once a process), so that no frame is lost to a compiler later."""
    from acquire.hdf5.checksum_loops import fletcher32, scratch

    fletcher32(np.zeros(3, np.uint8), *scratch())


class PictureStack:
    """Appends to a dataset that has ``maxshape[0] = None`` and one chunk a picture.

    A picture is in the file at once; that it is there, HDF5 writes with the next flush.

    Parameters
    ----------
    dataset : h5py.Dataset
        Its filters may be Fletcher-32, and before that shuffle and gzip together (``COMPRESSED``).
    """

    def __init__(self, dataset: h5py.Dataset) -> None:
        self._deflated = bool(dataset.shuffle) and dataset.compression == "gzip"
        if dataset.chunks != (1, *dataset.shape[1:]) or (_has_filters(dataset) and not self._deflated):
            raise ValueError(f"{dataset.name}: a chunk is not just one picture")
        self._id = dataset.id
        self._shape: tuple[int, ...] = dataset.shape[1:]
        self._checked = bool(dataset.fletcher32)
        self.dtype: np.dtype[Any] = dataset.dtype
        self.length = int(dataset.shape[0])
        self.row_bytes = int(np.prod(self._shape)) * self.dtype.itemsize
        # Deflated noise is a little larger than before.
        room = self.row_bytes + (self.row_bytes >> 10) + 64 if self._deflated else self.row_bytes
        self._chunk = np.empty(room + 4 * self._checked, np.uint8)
        self._picture = self._chunk[: self.row_bytes].view(self.dtype).reshape(self._shape)
        if self._checked:
            from acquire.hdf5.checksum_loops import scratch

            compile_loops()
            self._scratch = scratch()

    def append(self, picture: NDArray[Any]) -> None:
        """Add one picture of the dataset's shape; values must fit its type.

        Raises
        ------
        OSError or RuntimeError
            From HDF5, on a full disk among others.
        """
        np.copyto(self._picture, picture, casting="same_kind")
        size = self._deflate() if self._deflated else self.row_bytes
        if self._checked:
            size = self._seal(size)
        self._id.set_extent((self.length + 1, *self._shape))
        self._id.write_direct_chunk((self.length, *(0 for _ in self._shape)), self._chunk[:size])
        self.length += 1

    def _deflate(self) -> int:
        """Shuffle and deflate the picture in its place, as HDF5's filters do; its bytes then."""
        planes = self._chunk[: self.row_bytes].reshape(-1, self.dtype.itemsize).T
        packed = zlib.compress(planes.tobytes(), COMPRESSED["compression_opts"])
        self._chunk[: len(packed)] = np.frombuffer(packed, np.uint8)
        return len(packed)

    def _seal(self, size: int) -> int:
        """Put the checksum behind ``size`` bytes, low byte first as the format wants it; the bytes then."""
        from acquire.hdf5.checksum_loops import fletcher32

        checksum = int(fletcher32(self._chunk[:size], *self._scratch))
        self._chunk[size : size + 4] = np.frombuffer(checksum.to_bytes(4, "little"), np.uint8)
        return size + 4


def _has_filters(dataset: h5py.Dataset) -> bool:
    return dataset.compression is not None or bool(dataset.shuffle)


class PictureReader:
    """Reads the pictures of a dataset; one with another layout, or with bytes in doubt, is left to the library.

    Parameters
    ----------
    dataset : h5py.Dataset
    """

    def __init__(self, dataset: h5py.Dataset) -> None:
        self._dataset = dataset
        self._shape: tuple[int, ...] = dataset.shape[1:]
        self._bytes = int(np.prod(self._shape)) * dataset.dtype.itemsize
        alone = dataset.id.get_create_plist().get_nfilters() == 1
        self._sealed = bool(dataset.fletcher32) and alone and dataset.chunks == (1, *self._shape)
        self._count = 0

    def __getitem__(self, number: int) -> NDArray[Any]:
        """The picture ``number``, of the dataset's shape and type.

        Raises
        ------
        OSError, RuntimeError, ValueError or IndexError
            From HDF5, where it cannot be read.
        """
        self._count += 1
        if self._sealed and ("numba" in sys.modules or self._count > _WORTH_NUMBA):
            # The library reports what is wrong with it.
            with contextlib.suppress(OSError, RuntimeError, ValueError, OverflowError):
                if (picture := self._at_once(number)) is not None:
                    return picture
        return np.asarray(self._dataset[number])

    def _at_once(self, number: int) -> NDArray[Any] | None:
        """The chunk as it stands in the file, without its checksum; None where that is not right."""
        from acquire.hdf5.checksum_loops import fletcher32, scratch

        chunk = np.empty(self._bytes + 4, np.uint8)
        place = (number, *(0 for _ in self._shape))
        unfiltered, stored = self._dataset.id.read_direct_chunk(place, out=chunk)
        if unfiltered or len(stored) != len(chunk):
            return None
        content = chunk[: self._bytes]
        if chunk[self._bytes :].view("<u4")[0] != fletcher32(content, *scratch()):
            return None
        return np.asarray(content.view(self._dataset.dtype).reshape(self._shape))
