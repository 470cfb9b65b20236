"""Appending pictures to an HDF5 file, one chunk each, past the library's own filter.

HDF5 computes its Fletcher-32 byte by byte within the flush: most of the time of a recorded frame. Here
the chunk is made whole by our own code, to the same bytes, and handed over as it will stand in the file.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray


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
        Its only filter may be Fletcher-32.
    """

    def __init__(self, dataset: h5py.Dataset) -> None:
        if dataset.chunks != (1, *dataset.shape[1:]) or dataset.compression is not None or dataset.shuffle:
            raise ValueError(f"{dataset.name}: a chunk is not just one picture")
        self._id = dataset.id
        self._shape: tuple[int, ...] = dataset.shape[1:]
        self._checked = bool(dataset.fletcher32)
        self.dtype: np.dtype[Any] = dataset.dtype
        self.length = int(dataset.shape[0])
        self.row_bytes = int(np.prod(self._shape)) * self.dtype.itemsize
        self._chunk = np.empty(self.row_bytes + 4 * self._checked, np.uint8)
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
        if self._checked:
            self._seal()
        self._id.set_extent((self.length + 1, *self._shape))
        self._id.write_direct_chunk((self.length, *(0 for _ in self._shape)), self._chunk)
        self.length += 1

    def _seal(self) -> None:
        """Put the checksum behind the picture, low byte first as the format wants it."""
        from acquire.hdf5.checksum_loops import fletcher32

        content = self._chunk[: self.row_bytes]
        self._chunk[self.row_bytes :].view("<u4")[0] = fletcher32(content, *self._scratch)
