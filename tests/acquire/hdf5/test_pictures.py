"""Pictures handed to HDF5 as finished chunks: the same bytes that the library would have written."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from numpy.typing import NDArray

from acquire.hdf5 import PictureStack

SIZES = [(1, 1), (3, 5), (12, 16), (37, 101), (360, 512), (363, 1025)]


def new_stack(file: h5py.File, name: str, shape: tuple[int, ...], dtype: Any, **more: Any) -> h5py.Dataset:
    more = {"chunks": (1, *shape), "fletcher32": True} | more
    return file.create_dataset(name, (0, *shape), dtype, maxshape=(None, *shape), **more)


def pictures(shape: tuple[int, ...], dtype: Any) -> list[NDArray[Any]]:
    top = np.iinfo(dtype).max
    noise = np.random.default_rng(1).integers(0, top, shape, dtype, endpoint=True)
    one = np.zeros(shape, dtype)
    one.flat[-1] = 1
    return [noise, np.zeros(shape, dtype), np.full(shape, top, dtype), one]


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.uint32])
@pytest.mark.parametrize("shape", SIZES, ids=str)
def test_the_bytes_are_those_of_hdf5(tmp_path: Path, shape: tuple[int, ...], dtype: Any) -> None:
    with h5py.File(tmp_path / "both.h5", "w") as file:
        ours, theirs = new_stack(file, "ours", shape, dtype), new_stack(file, "theirs", shape, dtype)
        stack = PictureStack(ours)
        for k, picture in enumerate(pictures(shape, dtype)):
            stack.append(picture)
            theirs.resize(k + 1, axis=0)
            theirs[k] = picture
    with h5py.File(tmp_path / "both.h5") as file:
        for k, picture in enumerate(pictures(shape, dtype)):
            at = (k, *(0 for _ in shape))
            chunks = [file[name].id.read_direct_chunk(at) for name in ("ours", "theirs")]
            assert chunks[0] == chunks[1]
            assert len(chunks[0][1]) == picture.nbytes + 4
            np.testing.assert_array_equal(file["ours"][k], picture)


def test_a_flipped_bit_is_seen_by_hdf5(tmp_path: Path) -> None:
    path = tmp_path / "one.h5"
    with h5py.File(path, "w") as file:
        dataset = new_stack(file, "image", (12, 16), np.uint8)
        PictureStack(dataset).append(pictures((12, 16), np.uint8)[0])
        place = dataset.id.get_chunk_info(0).byte_offset
    content = bytearray(path.read_bytes())
    content[place + 7] ^= 1
    path.write_bytes(content)
    with h5py.File(path) as file, pytest.raises(OSError, match="filter returned failure"):
        file["image"][0]


def test_without_a_checksum_the_chunk_is_the_picture(tmp_path: Path) -> None:
    picture = pictures((12, 16), np.uint16)[0]
    with h5py.File(tmp_path / "plain.h5", "w") as file:
        dataset = new_stack(file, "image", (12, 16), np.uint16, fletcher32=False)
        PictureStack(dataset).append(picture)
        assert dataset.id.read_direct_chunk((0, 0, 0))[1] == picture.tobytes()


@pytest.mark.parametrize(
    "more", [{"chunks": (2, 12, 16)}, {"compression": "gzip"}, {"shuffle": True}], ids=str
)
def test_chunks_of_another_kind_are_refused(tmp_path: Path, more: dict[str, Any]) -> None:
    with h5py.File(tmp_path / "odd.h5", "w") as file, pytest.raises(ValueError, match="not just one picture"):
        PictureStack(new_stack(file, "image", (12, 16), np.uint8, **more))
