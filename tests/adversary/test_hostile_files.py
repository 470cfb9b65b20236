"""Sessions and strain files that are not as phasedic writes them: exit code 4 and a message, nothing opened outside."""

from __future__ import annotations

import json
import shutil
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from acquire.errors import DataError
from acquire.session import Session, recover
from live.cli import main
from live.results import Results, Strain
from tests.acquire.session.fixtures import frame, sample, writer
from tests.adversary.structure import make_fifo
from tests.live.made_up import make_grid, make_measurement
from tests.live.replay.test_replay import RECORDED
from tests.live.results.test_writer_and_reader import INFO


def replaced(name: str, make: Callable[[Any], Any], **how: Any) -> Callable[[h5py.File], None]:
    """Another dataset under ``name``, made of the values of the old one."""

    def change(file: h5py.File) -> None:
        values = make(file[name][()])
        del file[name]
        file.create_dataset(name, data=values, **how)

    return change


def said(name: str, /, **values: Any) -> Callable[[h5py.File], None]:
    """Other values in the JSON object ``name``."""
    return replaced(name, lambda text: np.bytes_(json.dumps(json.loads(text) | values)))


def put(name: str, row: int, value: Any) -> Callable[[h5py.File], None]:
    def change(file: h5py.File) -> None:
        file[name][row] = value

    return change


def event(row: int, /, **values: Any) -> Callable[[h5py.File], None]:
    def change(file: h5py.File) -> None:
        events = file["entry/events"]
        events[row] = json.dumps(json.loads(events[row]) | values).encode()

    return change


FRAMES, CAMERA = "entry/frames", "entry/instrument/camera/description"
RGB = np.dtype([("r", "u1"), ("g", "u1"), ("b", "u1")])
SESSIONS: dict[str, tuple[Callable[[h5py.File], None], str]] = {
    "a shorter column": (replaced(f"{FRAMES}/index", lambda v: v[:-3]), "18 to 21 rows"),
    "a longer column": (replaced(f"{FRAMES}/clock", lambda v: np.resize(v, 40)), "21 to 40 rows"),
    "a column of another type": (replaced(f"{FRAMES}/index", lambda v: v.astype("f4")), "index is float32"),
    "a column of two dimensions": (replaced("entry/load/force", lambda v: v[:, None]), r"shape \(159, 1\)"),
    "a column that is one value": (replaced("entry/load/force", lambda v: v[0]), r"shape \(\)"),
    "flags beyond the known": (put("entry/load/flags", 3, 2**31), "flags is 2147483648 in row 3"),
    "a clock that nobody knows": (put(f"{FRAMES}/clock", 2, 9), "clock is 9 in row 2"),
    "stable that is no answer": (put("entry/load/stable", 0, 5), "stable is 5"),
    "lines beyond their end": (put("entry/load/line_end", 5, 10**9), "lines of the samples"),
    "pictures of two dimensions": (replaced(f"{FRAMES}/image", lambda v: v[:, 0]), r"\(N, 112, 144\)"),
    "pictures of four dimensions": (replaced(f"{FRAMES}/image", lambda v: v[..., None]), r"\(N, 112, 144\)"),
    "pictures of compounds": (replaced(f"{FRAMES}/image", lambda v: np.zeros(v.shape, RGB)), "image is"),
    "pictures of texts": (replaced(f"{FRAMES}/image", lambda v: v.astype("S3")), r"image is \|S3"),
    "big-endian pictures": (replaced(f"{FRAMES}/image", lambda v: v.astype(">u2")), "image is >u2"),
    "pictures of another size": (said(CAMERA, width=16), "image is uint8"),
    "bits beyond sense": (said(CAMERA, bits=99), "'bits' is 99"),
    "config that is a list": (replaced("entry/config", lambda v: np.bytes_(b"[1]")), "config is not a JSON object"),
    "an impossible configuration": (said("entry/config", measure={"zoi": "big"}), "zoi"),
    "metadata that is a number": (replaced("entry/metadata", lambda v: np.bytes_(b"5")), "metadata is not a JSON"),
    "metadata that is no JSON": (replaced("entry/metadata", lambda v: np.bytes_(b"{")), "metadata is not JSON"),
    "JSON without a bottom": (replaced("entry/metadata", lambda v: np.bytes_(b"[" * 9999)), "metadata is not JSON"),
    "a reference that is a text": (event(1, data={"first": "0", "last": 3, "n": 4}), "'first' is '0'"),
    "a reference of no frames": (event(1, data={"first": 0, "last": 3, "n": 0}), "'n' is 0"),
    "a reference without data": (event(1, data=None), "'data' is None"),
    "a reference that was not recorded": (event(1, data={"first": 50, "last": 53, "n": 4}), "only 0 of 4"),
    "sequence numbers that run backwards": (replaced(f"{FRAMES}/index", lambda v: v[::-1]), "do not increase"),
    "a sequence number that stands still": (
        replaced(f"{FRAMES}/index", lambda v: np.where(np.arange(v.size) == 7, v[6], v)),
        "numbers of frames do not increase at row 7",
    ),
    "an infinite time": (put(f"{FRAMES}/monotonic_s", 4, np.inf), "monotonic_s is inf in row 4"),
    "a crop that is text": (lambda f: f["entry"].attrs.__setitem__("crop", "all"), "@crop is"),
    "a version that is text": (lambda f: f.attrs.__setitem__("format_version", "one"), "@format_version is"),
    "no start": (lambda f: f["entry"].__delitem__("start_time"), "start_time is missing"),
    "a start that is no time": (replaced("entry/start_time", lambda v: np.bytes_(b"noon")), "description cannot be"),
    "an entry that is no group": (lambda f: (f.__delitem__("entry"), f.__setitem__("entry", 1)), "is not a group"),
}  # fmt: skip


@pytest.fixture
def session(tmp_path: Path) -> Path:
    return Path(shutil.copy(RECORDED / "session.h5", tmp_path / "session.h5"))


def refused(path: Path, out: Path, capfd: pytest.CaptureFixture[str]) -> str:
    """The message of a replay that ends with exit code 4."""
    code = main(["replay", str(path), "--out", str(out), "--no-view", "--no-rrd"])
    said = capfd.readouterr().err
    assert code == 4, said
    assert "Traceback" not in said
    assert not out.exists()
    return said


@pytest.mark.parametrize("case", SESSIONS)
def test_a_malformed_session_is_refused_in_words(
    session: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str], case: str
) -> None:
    change, words = SESSIONS[case]
    with h5py.File(session, "r+") as file:
        change(file)
    text = refused(session, tmp_path / "out", capfd)
    assert str(session) in text
    with pytest.raises(DataError, match=words):
        raise DataError(text)


OUTSIDE = ["external link", "soft link", "external storage", "virtual", "unlimited virtual", "group"]


@pytest.mark.parametrize("kind", OUTSIDE)
@pytest.mark.parametrize("other", ["a pipe", "another session"])
def test_nothing_outside_the_file_is_opened(
    session: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str], kind: str, other: str
) -> None:
    outside = make_fifo(tmp_path / "fifo") if other == "a pipe" else RECORDED / "session.h5"
    name = f"{FRAMES}/image"
    with h5py.File(session, "r+") as file:
        shape, dtype = file[name].shape, file[name].dtype
        layout = h5py.VirtualLayout(shape, dtype, maxshape=(None, *shape[1:]))
        source = h5py.VirtualSource(str(outside), name, shape, dtype, maxshape=(None, *shape[1:]))
        if kind == "group":
            del file["entry"]
            file["entry"] = h5py.ExternalLink(str(outside), "/entry")
        else:
            del file[name]
        if kind == "external link":
            file[name] = h5py.ExternalLink(str(outside), name)
        elif kind == "soft link":
            file[name] = h5py.SoftLink("/entry/bursts/sum")
        elif kind == "external storage":
            file.create_dataset(name, shape, dtype, external=[(str(outside), 0, int(np.prod(shape)))])
        elif kind == "virtual":
            layout[...] = source
            file.create_virtual_dataset(name, layout)
        elif kind == "unlimited virtual":
            layout[: h5py.h5s.UNLIMITED] = source[: h5py.h5s.UNLIMITED]
            file.create_virtual_dataset(name, layout)
    text = refused(session, tmp_path / "out", capfd)
    assert "another place" in text or "another file" in text, text


def test_a_pipe_or_a_folder_is_no_session(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "folder.h5"
    folder.mkdir()
    for path in (folder, make_fifo(tmp_path / "session.h5")):
        assert "no regular file" in refused(path, tmp_path / "out", capfd)
        with pytest.raises(DataError, match="no regular file"):
            recover(path)


def test_times_that_run_backwards_are_reported(session: Path) -> None:
    with h5py.File(session, "r+") as file:
        times = file[f"{FRAMES}/monotonic_s"]
        times[10:] = times[10:] - 3600.0
        loads = file["entry/load/monotonic_s"]
        loads[5] = np.nan
        loads[30] = loads[30] - 60.0
    with Session.open(session) as back:
        words = back.recovered or ""
        assert len(back) == 21 and len(back.load_samples()) == 158
        assert "times of frames run backwards at 1 places, first after row 9" in words
        assert "1 of 159 load have no time" in words and "times of load run backwards at 1 places" in words


def test_the_lines_stay_with_their_samples(session: Path) -> None:
    with Session.open(session) as whole:
        lines = [s.raw for s in whole.load_samples()]
    with h5py.File(session, "r+") as file:
        file["entry/load/monotonic_s"][5] = np.nan
    with Session.open(session) as back:
        assert [s.raw for s in back.load_samples()] == [*lines[:5], *lines[6:]]


def test_recover_saves_what_is_whole_of_a_malformed_session(session: Path, tmp_path: Path) -> None:
    with h5py.File(session, "r+") as file:
        SESSIONS["a shorter column"][0](file)
        file["entry/load/flags"][3] = 2**31
        file["entry/events"][4] = b"{"
    done = recover(session, tmp_path / "clean.h5")
    assert (done.frames, done.load_samples) == (18, 158)
    assert any("158" in words or "1 of 159" in words for words in done.unreadable)
    with Session.open(done.path) as back, Session.open(RECORDED / "session.h5") as whole:
        assert back.recovered is None
        for number in range(18):
            np.testing.assert_array_equal(back.frame(number).image, whole.frame(number).image)


@pytest.mark.parametrize("tenths", range(3, 10))
def test_of_a_session_that_is_cut_no_padding_is_taken_for_a_value(
    session: Path, tmp_path: Path, tenths: int
) -> None:
    content = session.read_bytes()
    session.write_bytes(content[: len(content) * tenths // 10])
    try:
        done = recover(session, tmp_path / "clean.h5")
    except DataError:
        return  # its description is beyond the cut
    assert not [words for words in done.unreadable if "run backwards" in words]
    with Session.open(done.path) as back, Session.open(RECORDED / "session.h5") as whole:
        assert back.recovered is None
        known = {one.t: one for one in whole.load_samples()}
        assert all(known[one.t] == one for one in back.load_samples())
        pictures = {one.index: one for one in whole.frames()}
        for one in back.frames():
            assert one.t == pictures[one.index].t
            np.testing.assert_array_equal(one.image, pictures[one.index].image)


# -- results ------------------------------------------------------------------------------------


STRAINS: dict[str, tuple[Callable[[h5py.File], None], str]] = {
    "a shorter column": (replaced("entry/mean/eyy", lambda v: v[:-1]), "not of one length"),
    "a column of texts": (replaced("entry/mean/eyy", lambda v: v.astype("S9")), r"eyy is \|S9"),
    "no time": (lambda f: f["entry/mean"].__delitem__("time_s"), "time_s is missing"),
    "maps of two dimensions": (replaced("entry/strain/eyy", lambda v: v[:, 0]), "eyy is float32"),
    "maps of another size": (replaced("entry/strain/eyy", lambda v: v[:, :-1]), "eyy is float32"),
    "a grid that is a list": (lambda f: f["entry/strain"].attrs.__setitem__("grid", "[]"), "not a JSON object"),
    "a grid beyond sense": (
        lambda f: f["entry/strain"].attrs.__setitem__(
            "grid", '{"roi": {"x": 0, "y": 0, "width": 60000, "height": 60000}, "size": 3, "step": 1}'
        ),
        "described as",
    ),
    "a step of nothing": (
        lambda f: f["entry/strain"].attrs.__setitem__(
            "grid", '{"roi": {"x": 0, "y": 0, "width": 600, "height": 600}, "size": 3, "step": 0}'
        ),
        "'step' is 0",
    ),
    "other centres": (put("entry/strain/x", 0, 99.0), "other centres x"),
    "config that is a number": (replaced("entry/config", lambda v: "7"), "config is not a JSON object"),
    "a link to another file": (
        lambda f: f["entry/mean"].__setitem__("more", h5py.ExternalLink("other.h5", "/")), "another place"
    ),
}  # fmt: skip


@pytest.fixture
def strain(tmp_path: Path) -> Path:
    with Results(tmp_path / "run", make_grid(), INFO) as results:
        for k in range(4):
            results.add(make_measurement(k, 1e-3 * k, force=1.0))
    return tmp_path / "run" / "strain.h5"


@pytest.mark.parametrize("case", STRAINS)
def test_a_malformed_strain_file_is_refused_in_words(
    strain: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str], case: str
) -> None:
    change, words = STRAINS[case]
    with h5py.File(strain, "r+") as file:
        change(file)
    assert main(["map", str(strain), str(tmp_path / "map.png")]) == 4
    text = capfd.readouterr().err
    assert "Traceback" not in text and str(strain) in text
    with pytest.raises(DataError, match=words):
        raise DataError(text)


def test_a_pipe_is_no_strain_file(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="not an HDF5 file"):
        Strain.open(make_fifo(tmp_path / "strain.h5"))


def test_columns_of_another_version_are_let_be(strain: Path) -> None:
    with h5py.File(strain, "r+") as file:
        file["entry/mean/more"] = np.arange(4, dtype="f4")
        del file["entry/mean/latency_s"]
    with Strain.open(strain) as back:
        assert back.n == 4 and "latency_s" not in back.values
        np.testing.assert_array_equal(back.values["more"], np.arange(4))


def test_odd_times_of_results_are_reported(strain: Path, caplog: pytest.LogCaptureFixture) -> None:
    with h5py.File(strain, "r+") as file:
        file["entry/mean/time_s"][[0, 2]] = [9.0, np.nan]
    with Strain.open(strain) as back:
        assert back.n == 4
    assert "1 rows have no time" in caplog.text and "1 times run backwards" in caplog.text


# -- files that are still written ---------------------------------------------------------------


def test_a_session_that_is_written_meanwhile_is_read_right(tmp_path: Path) -> None:
    path, stop = tmp_path / "session.h5", threading.Event()
    written = 0

    def write() -> None:
        nonlocal written
        while not stop.is_set():
            session.write_load(sample(written))
            session.write_frame(frame(written))
            written += 1
            time.sleep(0.001)

    with writer(path) as session:
        thread = threading.Thread(target=write)
        thread.start()
        try:
            seen = _follow(path)
        finally:
            stop.set()
            thread.join()
    assert seen <= written
    with Session.open(path) as back:
        assert (back.recovered, len(back), len(back.load_samples())) == (None, written, written)


def _follow(path: Path) -> int:
    """Opens and refreshes until 200 frames are there; the frames seen in the end, all of them right."""
    seen = 0
    while seen < 200:
        with Session.open(path) as back:
            assert back.recovered is not None and "still recording" in back.recovered
            for _ in range(10):
                back.refresh()
                assert len(back) >= seen
                for number in range(seen, len(back)):
                    np.testing.assert_array_equal(back.frame(number).image, frame(number).image)
                forces = [s.force for s in back.load_samples()]
                np.testing.assert_array_equal(forces, [sample(k).force for k in range(len(forces))])
                seen = len(back)
    return seen
