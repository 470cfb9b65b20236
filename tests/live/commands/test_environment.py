"""Where the program stands: other modules in the working folder, nothing that can be written, a damaged cache."""

from __future__ import annotations

import os
import stat
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from acquire import compiled_loops
from acquire.errors import ConfigError
from acquire.system import can_write, private_folder, python_command, python_environment
from live import VERSION
from live.commands import process

ROOT = Path(__file__).parents[3]


@pytest.mark.parametrize("name", ["analysis", "live", "signal", "json", "numpy"])
def test_a_child_takes_no_module_of_the_working_folder(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / f"{name}.py").write_text("raise SystemExit(77)\n")
    monkeypatch.setenv("PYTHONPATH", os.pathsep + "/nowhere")  # an empty entry is the working folder
    command = python_command("acquire.session", str(tmp_path / "none.h5"))
    done = subprocess.run(command, cwd=tmp_path, env=python_environment(), capture_output=True, text=True)
    assert done.returncode == 4 and "no such file" in done.stdout


@pytest.mark.parametrize(
    ("module", "name"),
    [("live", "analysis"), ("live", "signal"), ("live", "pathlib"), ("phasedic", "analysis")],
)
def test_nor_does_python_m(module: str, name: str, tmp_path: Path) -> None:
    (tmp_path / f"{name}.py").write_text("raise SystemExit(77)\n")
    done = subprocess.run(
        [sys.executable, "-m", module, "--version"],
        cwd=tmp_path, env={**os.environ, "PYTHONPATH": str(ROOT)}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stdout) == (0, f"phasedic {VERSION}\n"), done.stderr


def kept(folder: Path) -> Any:
    """A file of the cache, with one function of two signatures in it."""
    file = compiled_loops.KeptFile(str(folder), "f", 1)
    file.save("a", {"code": b"1" * 999})
    file.save("b", {"code": b"2" * 999})
    return file


def emptied(data: bytes) -> bytes:
    return b""


def halved(data: bytes) -> bytes:
    return data[: len(data) // 2]


def zeroed(data: bytes) -> bytes:
    return bytes(len(data))


def one_bit(data: bytes) -> bytes:
    return data[:50] + bytes([data[50] ^ 4]) + data[51:]


def random_bytes(data: bytes) -> bytes:
    return np.random.default_rng(1).bytes(len(data))


@pytest.mark.parametrize("harm", [emptied, halved, zeroed, one_bit, random_bytes])
def test_a_damaged_file_of_the_cache_is_as_if_it_were_not_there(harm: Any, tmp_path: Path) -> None:
    file = kept(tmp_path)
    assert file.load("a") == {"code": b"1" * 999} and file.load("b") == {"code": b"2" * 999}
    data = tmp_path / "f.1.nbc"
    data.write_bytes(harm(data.read_bytes()))
    assert file.load("a") is None and file.load("b") == {"code": b"2" * 999}
    file.save("a", {"code": b"3"})
    assert file.load("a") == {"code": b"3"} and file.load("b") == {"code": b"2" * 999}
    index = tmp_path / "f.nbi"
    index.write_bytes(harm(index.read_bytes()))
    assert file.load("a") is None and file.load("b") is None
    file.save("b", {"code": b"4"})
    assert file.load("b") == {"code": b"4"}


def test_numba_itself_reads_what_is_kept(tmp_path: Path) -> None:
    kept(tmp_path)
    assert compiled_loops.IndexDataCacheFile(str(tmp_path), "f", 1).load("b") == {"code": b"2" * 999}


def test_all_compiled_loops_are_checked() -> None:
    from acquire.burst.accumulate_loops import tile_sums
    from acquire.hdf5.checksum_loops import fletcher32
    from analysis.picture.prefilter import coefficients
    from hw_mocks.speckle_loops import splat

    for loop in (tile_sums, fletcher32, splat, getattr(coefficients, "dispatcher", coefficients)):
        assert isinstance(loop._cache._cache_file, compiled_loops.KeptFile)


def test_loops_are_kept_below_the_temporary_folder_where_nothing_else_can_be_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(process, "can_write", lambda folder: False)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    monkeypatch.setenv("NUMBA_CACHE_DIR", "")
    process.keep_loops()
    folder = Path(os.environ["NUMBA_CACHE_DIR"])
    assert folder.parent == tmp_path and stat.S_IMODE(folder.stat().st_mode) == 0o700
    assert len(caplog.messages) == 1 and str(folder) in caplog.text and "NUMBA_CACHE_DIR" in caplog.text
    monkeypatch.setattr(process, "can_write", can_write)
    process.keep_loops()  # a child process, or the next one with that in its environment
    assert len(caplog.messages) == 1 and os.environ["NUMBA_CACHE_DIR"] == str(folder)


def test_a_folder_that_others_can_write_to_is_not_used(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    first = private_folder("x")
    assert private_folder("x") == first
    first.chmod(0o777)
    other = private_folder("x")
    assert other != first and stat.S_IMODE(other.stat().st_mode) == 0o700
    first.rmdir()
    first.symlink_to(other)
    assert private_folder("x") not in (first, other)


def test_without_compiled_loops_nothing_is_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NUMBA_DISABLE_JIT", "0")
    process.check_environment()
    monkeypatch.setenv("NUMBA_DISABLE_JIT", "1")
    with pytest.raises(ConfigError, match="NUMBA_DISABLE_JIT is set: without compiled loops nothing can be"):
        process.check_environment()


def test_a_name_that_is_not_utf_8_is_stored_escaped(tmp_path: Path) -> None:
    import h5py

    from acquire.hdf5 import set_attributes

    name = os.fsdecode(b"Pr\xfcfung")
    with h5py.File(tmp_path / "a.h5", "w") as file:
        set_attributes(file, name=name, names=[name, "ä"])
        assert bytes(file.attrs["name"]) == rb"Pr\udcfcfung"
        assert [bytes(one) for one in file.attrs["names"]] == [rb"Pr\udcfcfung", "ä".encode()]
