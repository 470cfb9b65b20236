"""Files on their disk: free space, network shares, pictures as finished chunks, and bringing them to the disk."""

from __future__ import annotations

import errno
import math
import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import h5py
import numpy as np
import pytest
from numpy.typing import NDArray

from acquire.errors import DataError
from acquire.hdf5 import (
    COMPRESSED,
    DiskSync,
    JsonField,
    PaddedFile,
    PictureReader,
    PictureStack,
    check_size,
    compile_loops,
    create_file,
    read_superblock,
    reason,
    stored_rows,
    to_json,
)
from acquire.hdf5 import disk as pace_module
from acquire.hdf5.damage import METADATA_BYTES
from acquire.hdf5.disk import FlushTimer, forecast, free_bytes, network_share
from tests.acquire.session.fixtures import frame, writer
from tests.live.ui.waiting import until

ROOT = Path(__file__).parents[2]


def test_two_files_of_one_name_are_made_at_once(tmp_path: Path) -> None:
    """As two cameras do: each has its strain.h5, in a folder of its own."""
    for name in ("front", "back"):
        (tmp_path / name).mkdir()

    def declare(file: h5py.File) -> None:
        file.attrs["side"] = "front"
        create_file(tmp_path / "back" / "a.h5", lambda other: other.attrs.update(side="back")).close()

    create_file(tmp_path / "front" / "a.h5", declare).close()
    for name in ("front", "back"):
        with h5py.File(tmp_path / name / "a.h5") as file:
            assert file.attrs["side"] == name


DECLARED = """
import resource, sys
from pathlib import Path
from acquire.hdf5 import create_file
limit = int(sys.argv[2])
resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
def declare(file):
    for k in range(40):
        file.create_group(f"a{k}").create_dataset("b", (0,), "f8", maxshape=(None,), chunks=(256,)).attrs["units"] = "m"
try:
    create_file(Path(sys.argv[1]), declare).close()
except OSError as error:
    print(error.strerror)
"""


@pytest.mark.parametrize("limit", [0, 900, 5000, 20_000])
def test_a_file_without_room_for_its_groups_leaves_nothing(tmp_path: Path, limit: int) -> None:
    """HDF5 objects that were open on a full disk printed a traceback each."""
    path = tmp_path / "a.h5"
    done = subprocess.run(
        [sys.executable, "-c", DECLARED, path, str(limit)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.stdout, done.stderr) == ("File too large\n", "")
    assert not path.exists()


def test_a_new_file_is_read_while_it_grows_and_replaces_none(tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    file = create_file(path, lambda head: head.create_dataset("b", (0,), "f8", maxshape=(None,), chunks=(4,)))
    with file, h5py.File(path, "r", swmr=True) as reader:
        file["b"].resize((3,))
        file["b"][:] = [1.0, 2.0, 3.0]
        file.flush()
        reader["b"].refresh()
        assert reader["b"][:].tolist() == [1.0, 2.0, 3.0]
    content = path.read_bytes()
    with pytest.raises(FileExistsError):
        create_file(path, lambda head: head.create_group("other"))
    assert path.read_bytes() == content


def test_the_structure_of_a_long_file_takes_no_more_memory(tmp_path: Path) -> None:
    """Of each piece HDF5 keeps its place in memory: without a bound a file of hours takes megabytes."""
    names, rows = [f"map {k}" for k in range(10)], 3000

    def declare(file: h5py.File) -> None:
        for name in names:
            file.create_dataset(name, (0, 2, 2), "u1", maxshape=(None, 2, 2), chunks=(1, 2, 2))

    with create_file(tmp_path / "a.h5", declare) as file:
        stacks = [PictureStack(file[name]) for name in names]
        for row in range(rows):
            for stack in stacks:
                stack.append(np.full((2, 2), row % 256, np.uint8))
        largest, _, used, _ = file.id.get_mdc_size()
        assert largest == METADATA_BYTES and used <= METADATA_BYTES < 20 * rows * len(names)
    with h5py.File(tmp_path / "a.h5") as file:
        assert np.array_equal(file[names[-1]][:, 1, 1], np.arange(rows) % 256), (
            "what was let go is in the file"
        )


def test_forecast(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("acquire.hdf5.disk.free_bytes", lambda path: 70_200_000_000)
    assert forecast(tmp_path, 30 * 1.3e6) == pytest.approx(1800)
    assert forecast(tmp_path, 0.0) == math.inf


MOUNTS = """\
/dev/sda1 / ext4 rw 0 0
server:/lab /mnt/lab nfs4 rw 0 0
//nas/data /mnt/my\\040share cifs rw 0 0
/dev/sdb1 /mnt/lab/local xfs rw 0 0
"""


@pytest.mark.parametrize("turned", [False, True], ids=["", "in another order"])
def test_network_shares_are_known_by_the_innermost_mount(tmp_path: Path, turned: bool) -> None:
    mounts, lines = tmp_path / "mounts", MOUNTS.splitlines(keepends=True)
    mounts.write_text("".join(reversed(lines)) if turned else MOUNTS)
    kinds = {
        "/home/me/runs": None, "/mnt/lab": "nfs4", "/mnt/lab/runs/session.h5": "nfs4", "/mnt/laboratory/runs": None,
        "/mnt/my share/x": "cifs", "/mnt/lab/local/x": None,
    }  # fmt: skip
    assert {path: network_share(path, mounts) for path in kinds} == kinds
    assert network_share(tmp_path, tmp_path / "nothing") is None, "where nobody tells the mounts"


@pytest.mark.parametrize(
    "kind", ["nfs", "nfs4", "cifs", "smb3", "smbfs", "fuse.sshfs", "9p", "afs", "ceph", "davfs"]
)
def test_kinds_of_network_shares(tmp_path: Path, kind: str) -> None:
    mounts = tmp_path / "mounts"
    mounts.write_text(f"short line\nx / {kind} rw 0 0\n")
    assert network_share("/a", mounts) == kind
    mounts.write_text(f"x / {kind}x rw 0 0\n")
    assert network_share("/a", mounts) is None


def test_a_flush_is_due_once_something_has_waited_and_not_before() -> None:
    now = [100.0]
    timer = FlushTimer(0.25, lambda: now[0])
    assert timer.left_s() == math.inf, "nothing waits"
    timer.wrote()
    assert timer.left_s() == 0.0, "the first at once"
    timer.began()
    timer.done()
    now[0] += 0.1
    assert timer.left_s() == math.inf
    timer.wrote()
    assert timer.left_s() == pytest.approx(0.15)
    now[0] += 0.2
    assert timer.left_s() == 0.0


SIZES = [(1, 1), (3, 5), (12, 16), (37, 101), (360, 512), (363, 1025)]


def new_stack(file: h5py.File, name: str, shape: tuple[int, ...], dtype: Any, **more: Any) -> h5py.Dataset:
    more = {"chunks": (1, *shape), "fletcher32": True} | more
    return file.create_dataset(name, (0, *shape), dtype, maxshape=(None, *shape), **more)


def stored(file: h5py.File, name: str, rows: list[NDArray[Any]], **more: Any) -> h5py.Dataset:
    """A stack as the library writes it."""
    dataset = new_stack(file, name, rows[0].shape, rows[0].dtype, **more)
    dataset.resize(len(rows), axis=0)
    dataset[:] = rows
    return dataset


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
        stored(file, "theirs", pictures(shape, dtype))
        stack = PictureStack(new_stack(file, "ours", shape, dtype))
        for picture in pictures(shape, dtype):
            stack.append(picture)
    with h5py.File(tmp_path / "both.h5") as file:
        for k, picture in enumerate(pictures(shape, dtype)):
            at = (k, *(0 for _ in shape))
            chunks = [file[name].id.read_direct_chunk(at) for name in ("ours", "theirs")]
            assert chunks[0] == chunks[1]
            assert len(chunks[0][1]) == picture.nbytes + 4
            np.testing.assert_array_equal(file["ours"][k], picture)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.uint32])
@pytest.mark.parametrize("shape", SIZES, ids=str)
def test_compressed_pictures_come_back_through_the_library(
    tmp_path: Path, shape: tuple[int, ...], dtype: Any
) -> None:
    with h5py.File(tmp_path / "small.h5", "w") as file:
        stack = PictureStack(new_stack(file, "image", shape, dtype, **COMPRESSED))
        for picture in pictures(shape, dtype):
            stack.append(picture)
    with h5py.File(tmp_path / "small.h5") as file:
        reader = PictureReader(file["image"])
        for k, picture in enumerate(pictures(shape, dtype)):
            np.testing.assert_array_equal(file["image"][k], picture, strict=True)
            np.testing.assert_array_equal(reader[k], picture, strict=True)
        if picture.nbytes > 1000:
            assert file["image"].id.get_chunk_info(1).size < picture.nbytes / 50


def test_a_flipped_bit_is_seen_by_hdf5(tmp_path: Path) -> None:
    path = tmp_path / "one.h5"
    with h5py.File(path, "w") as file:
        dataset = new_stack(file, "image", (12, 16), np.uint8)
        PictureStack(dataset).append(pictures((12, 16), np.uint8)[0])
        place = dataset.id.get_chunk_info(0).byte_offset
    content = bytearray(path.read_bytes())
    content[place + 7] ^= 1
    path.write_bytes(content)
    with h5py.File(path) as file:
        for picture in (file["image"], PictureReader(file["image"])):
            with pytest.raises(OSError, match="filter returned failure"):
                picture[0]


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


class _Library:
    """A dataset that counts what is read through the library's filter."""

    def __init__(self, dataset: h5py.Dataset) -> None:
        self._dataset, self.reads = dataset, 0

    def __getattr__(self, name: str) -> Any:
        return getattr(self._dataset, name)

    def __getitem__(self, number: int) -> Any:
        self.reads += 1
        return self._dataset[number]


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.uint32])
@pytest.mark.parametrize("shape", SIZES, ids=str)
def test_what_is_read_is_what_was_written(tmp_path: Path, shape: tuple[int, ...], dtype: Any) -> None:
    compile_loops()
    with h5py.File(tmp_path / "theirs.h5", "w") as file:
        stored(file, "image", pictures(shape, dtype))
    with h5py.File(tmp_path / "theirs.h5") as file:
        reader = PictureReader(library := _Library(file["image"]))
        for k, picture in enumerate(pictures(shape, dtype)):
            np.testing.assert_array_equal(reader[k], picture, strict=True)
        assert library.reads == 0, "the library's filter was waited for"


def test_what_is_not_as_we_write_it_is_read_by_the_library(tmp_path: Path) -> None:
    picture = pictures((12, 16), np.uint16)[0]
    with h5py.File(tmp_path / "others.h5", "w") as file:
        stored(file, "plain", [picture], fletcher32=False)
        stored(file, "small", [picture], compression="gzip")
        stored(file, "two", [picture], chunks=(2, 12, 16))
        unfiltered = new_stack(file, "unfiltered", (12, 16), np.uint16)
        unfiltered.resize(2, axis=0)
        unfiltered.id.write_direct_chunk((0, 0, 0), picture.tobytes(), filter_mask=1)
    with h5py.File(tmp_path / "others.h5") as file:
        for name in ("plain", "small", "two", "unfiltered"):
            np.testing.assert_array_equal(PictureReader(file[name])[0], picture, strict=True)
        assert not PictureReader(file["unfiltered"])[1].any(), "what was never written is the fill value"
        with pytest.raises(IndexError):
            PictureReader(file["unfiltered"])[2]


@pytest.fixture
def brought(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The size of the file each time it is brought to the disk."""
    sizes, plain = list[int](), os.fdatasync

    def bring(file: int) -> None:
        sizes.append(os.fstat(file).st_size)
        plain(file)

    monkeypatch.setattr(os, "fdatasync", bring)
    return sizes


def test_it_is_brought_again_and_again_and_at_the_end(tmp_path: Path, brought: list[int]) -> None:
    path = tmp_path / "a"
    path.write_bytes(b"1")
    to_disk = DiskSync(path, every_s=0.02)
    until(lambda: len(brought) > 2)
    path.write_bytes(b"1234")
    to_disk.close()
    assert brought[0] == 1 and brought[-1] == 4
    count = len(brought)
    to_disk.close()
    assert len(brought) == count and to_disk.failure is None


def test_what_grows_fast_is_brought_sooner(
    tmp_path: Path, brought: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a"
    monkeypatch.setattr(pace_module, "SYNC_BYTES", 1000)
    path.write_bytes(b"1")
    to_disk = DiskSync(path, every_s=1e6)
    path.write_bytes(bytes(1000))
    until(lambda: brought == [1000])
    path.write_bytes(bytes(1999))
    to_disk.close()
    assert brought == [1000, 1999], "the rest at the end alone"


def test_the_memory_of_what_was_brought_is_let_go_but_for_the_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, given = tmp_path / "a", list[tuple[int, int]]()
    path.write_bytes(bytes(3_000_000))
    monkeypatch.setattr(pace_module, "KEPT_BYTES", 1_000_000)
    monkeypatch.setattr(os, "posix_fadvise", lambda file, start, size, advice: given.append((start, size)))
    DiskSync(path).close()
    assert given == [(0, 2_000_000)]


@pytest.mark.parametrize(("code", "fails"), [(errno.EIO, True), (errno.ENOSPC, True), (errno.EINVAL, False)])
def test_a_disk_that_fails_ends_the_recording_and_one_that_cannot_is_let_be(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, code: int, fails: bool
) -> None:
    tried = list[int]()

    def refuse(file: int) -> None:
        tried.append(file)
        raise OSError(code, os.strerror(code))

    monkeypatch.setattr(DiskSync.__init__, "__defaults__", (0.01,))
    session = writer(tmp_path / "session.h5")
    monkeypatch.setattr(os, "fdatasync", refuse)

    if fails:
        with pytest.raises(DataError, match=r"session\.h5: "):
            until(lambda: session.write_frame(frame(0)) < 0)
    else:
        until(lambda: tried)
        for number in range(5):
            session.write_frame(frame(number))
        session.close()


def test_the_nearest_folder_that_is_there_counts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[Path] = []

    def usage(place: Path) -> Any:
        asked.append(place)
        return SimpleNamespace(free=7)

    monkeypatch.setattr(pace_module.shutil, "disk_usage", usage)
    (tmp_path / "there.h5").touch()
    for name in ("there.h5", "a/b/session.h5", "."):
        assert free_bytes(tmp_path / name) == 7
    assert free_bytes("/no such folder/a") == 7
    assert asked == [tmp_path / "there.h5", tmp_path, tmp_path, Path("/")]


def test_what_is_recorded_is_on_the_disk_within_a_second() -> None:
    """Or after 32 MiB, of which the last 8 stay in memory; the last time is waited for, but not for ever."""
    assert (pace_module.SYNC_S, pace_module.SYNC_BYTES, pace_module.KEPT_BYTES) == (1.0, 2**25, 2**23)
    assert pace_module.CLOSE_TIMEOUT_S == 10.0


def test_rows_before_a_hole_are_those_that_are_stored(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.h5", "w") as file:
        rows = file.create_dataset("rows", (12,), "f8", maxshape=(None,), chunks=(4,))
        assert stored_rows(rows) == 0
        rows[0:4] = rows[8:12] = 1.0
        assert stored_rows(rows) == 4
        rows[4:8] = 1.0
        assert stored_rows(rows) == 12
        wide = file.create_dataset("wide", (4, 6), "u1", maxshape=(None, 6), chunks=(2, 4))
        wide[:, :] = 1
        assert stored_rows(wide) == 4
        holed = file.create_dataset("holed", (4, 6), "u1", maxshape=(None, 6), chunks=(2, 4))
        holed[0:2, :] = 1
        holed[2:4, 0:4] = 1
        assert stored_rows(holed) == 2
        assert stored_rows(file.create_dataset("flat", data=np.ones(5))) == 5
        assert stored_rows(file.create_dataset("empty", (5,), "f8")) == 0


def test_the_first_bytes_of_a_file_tell_its_size_and_whether_it_is_finished(tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    file = create_file(path, lambda head: head.create_dataset("b", data=np.arange(1000)))
    file.flush()
    assert read_superblock(path).unfinished
    file.close()
    block = read_superblock(path)
    assert (block.unfinished, block.size) == (False, path.stat().st_size)
    check_size(path, block)
    content = path.read_bytes()
    path.write_bytes(content[:-1])
    with pytest.raises(
        DataError, match=rf"is truncated: {len(content) - 1} of {len(content)} bytes are there"
    ):
        check_size(path, block)
    path.write_bytes(content[:47])
    with pytest.raises(DataError, match="is truncated to 47 bytes; nothing in it can be read"):
        read_superblock(path)
    with PaddedFile(path, 60) as padded:
        assert padded.read() == content[:47] + bytes(13)
        assert padded.seek(-15, os.SEEK_END) == 45 and padded.read() == content[45:47] + bytes(13)
        assert padded.seek(-3, os.SEEK_END) == 57
        with pytest.raises(OSError, match="cut off before it"):
            padded.read()
        assert padded.seek(5) == 5 and padded.seek(2, os.SEEK_CUR) == 7 and padded.read(2) == content[7:9]
    with pytest.raises(DataError, match="is no regular file"):
        read_superblock(tmp_path)


@pytest.mark.parametrize(
    ("field", "taken", "refused"),
    [
        (JsonField(int, 1, 3), [1, 3], [0, 4, True, 2.0, "2", None]),
        (JsonField(float, 0, 1), [0, 0.5, 1], [-0.1, 1.1, True, math.nan, "0.5", None]),
        (JsonField(float), [1e300, 5], [math.inf, math.nan]),
        (JsonField(bool), [True, False], [0, 1, "true", None]),
        (JsonField(str, words=("a", "b")), ["a", "b"], ["", "ab", None, 5]),
        (JsonField(str), ["", "x"], [None, b"x"]),
        (JsonField(dict), [{}], [[], None]),
        (JsonField(int, missing=True), [None, 5], ["5"]),
    ],
)
def test_what_a_value_in_json_may_be(field: JsonField, taken: list[Any], refused: list[Any]) -> None:
    assert [field.takes(value) for value in taken] == [True] * len(taken)
    assert [field.takes(value) for value in refused] == [False] * len(refused)


def test_words_of_the_library_are_shortened() -> None:
    assert reason(OSError("a (errno = 28, error message = 'No space left on device', buf = 0)")) == (
        "No space left on device"
    )
    assert reason(OSError(5, "Input/output error")) == "Input/output error"
    assert reason(RuntimeError("a\n  b" + "c" * 300)) == "a b" + "c" * 197


def test_strict_json_of_what_python_has() -> None:
    value = {
        1: (math.inf, np.float32(0.5), np.arange(2)),
        "a": {"b": math.nan, "c": Path("x")},
        "d": [True, None],
    }
    assert to_json(value) == '{"1": [null, 0.5, [0, 1]], "a": {"b": null, "c": "x"}, "d": [true, null]}'
