"""What all of ``acquire`` uses: clocks, texts, closing, OpenCV's limits, and imports that stay light."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
import time
import zlib
from datetime import UTC, datetime, timedelta, timezone
from pathlib import Path

import pytest

from acquire.clock import ClockPair
from acquire.opening import Closing


def test_a_time_is_written_in_utc() -> None:
    at_nine = datetime(2026, 5, 9, 9, 35, 25, 123456, tzinfo=timezone(timedelta(hours=2)))
    assert ClockPair(0.0, at_nine).iso() == "2026-05-09T07:35:25.123456Z"


@pytest.mark.parametrize(
    ("text", "utc"),
    [
        ("2026-05-09T07:35:25.123456Z", datetime(2026, 5, 9, 7, 35, 25, 123456, UTC)),
        ("2026-05-09T07:35:25", datetime(2026, 5, 9, 7, 35, 25, 0, UTC)),
        ("2026-05-09T09:35:25+02:00", datetime(2026, 5, 9, 9, 35, 25, 0, timezone(timedelta(hours=2)))),
    ],
)
def test_a_time_without_a_zone_is_utc(text: str, utc: datetime, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TZ", "XYZ-13")
    time.tzset()
    assert ClockPair.from_iso(3.5, text) == ClockPair(3.5, utc)
    monkeypatch.undo()
    time.tzset()


def test_now_is_now() -> None:
    before = time.monotonic()
    pair = ClockPair.now()
    assert before <= pair.monotonic <= time.monotonic()
    assert pair.utc.tzinfo is UTC


def test_what_is_no_time_is_refused() -> None:
    with pytest.raises(ValueError):
        ClockPair.from_iso(0.0, "yesterday")


class Thing(Closing):
    closed = 0

    def close(self) -> None:
        self.closed += 1


def test_with_gives_the_thing_itself_and_closes_it() -> None:
    with Thing() as thing:
        assert thing.closed == 0
    assert thing.closed == 1


def test_an_error_inside_closes_and_comes_through() -> None:
    thing = Thing()
    with pytest.raises(LookupError), thing:
        raise LookupError
    assert thing.closed == 1


def test_what_cannot_be_closed_cannot_be_made() -> None:
    with pytest.raises(TypeError, match="close"):
        type("Open", (Closing,), {})()


ROOT = Path(__file__).parents[2]
READERS = {
    "images": "from acquire.opencv.images import read_image as read",
    "dark and flat frames": "from acquire.burst import load_mean as read",
}
# Something else comes first: the renderer of the simulated specimen, which needs OpenCV too.
FIRST = {
    "nothing": "",
    "the simulator": "from hw_mocks.speckle import Speckle; Speckle((64, 64), contrast=0.2)",
}


def asks_for_gigabytes(path: Path) -> Path:
    """A small PNG whose header says 30,000x30,000 pixels of 16 bits, four channels: 7.2 GB."""
    header = b"IHDR" + (30_000).to_bytes(4, "big") * 2 + bytes([16, 6, 0, 0, 0])
    body = b"IDAT" + zlib.compress(bytes(1000))
    chunks = b"".join(
        (len(chunk) - 4).to_bytes(4, "big") + chunk + zlib.crc32(chunk).to_bytes(4, "big")
        for chunk in (header, body, b"IEND")
    )
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + chunks)
    return path


@pytest.mark.parametrize("package", ["acquire", "hw_mocks"])
def test_nobody_else_imports_cv2(package: str) -> None:
    found = [
        path.relative_to(ROOT).as_posix()
        for path in sorted((ROOT / package).rglob("*.py"))
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if (isinstance(node, ast.Import) and any(a.name.split(".")[0] == "cv2" for a in node.names))
        or (isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "cv2")
    ]
    assert found == (["acquire/cv2_loader.py"] if package == "acquire" else [])


@pytest.mark.parametrize("first", FIRST)
@pytest.mark.parametrize("reader", READERS)
def test_a_header_that_asks_for_gigabytes_is_refused_before_they_are_taken(
    tmp_path: Path, reader: str, first: str
) -> None:
    program = f"""
import sys
{FIRST[first]}
{READERS[reader]}
from acquire.errors import DataError

def most_kB():
    return next(int(line.split()[1]) for line in open("/proc/self/status") if line.startswith("VmPeak"))

try:
    read({str(tmp_path / "no.png")!r})
except DataError:
    before = most_kB()
try:
    read(sys.argv[1])
except DataError as error:
    print(most_kB() - before, error)
"""
    path = asks_for_gigabytes(tmp_path / "a.png")
    done = subprocess.run(
        [sys.executable, "-c", program, str(path)], capture_output=True, text=True, cwd=ROOT
    )
    taken_kB, _, told = done.stdout.partition(" ")
    assert f"{path}: " in told and ("not a" in told or "more than 268 million pixels" in told), done.stderr
    assert int(taken_kB) < 1_000_000


def loaded_by(statement: str) -> set[str]:
    """Modules in a fresh process after ``statement``."""
    code = f"{statement}\nimport sys\nprint(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, check=True)
    return set(done.stdout.split())


def test_the_errors_alone_load_no_room_and_no_library() -> None:
    ours = {name for name in loaded_by("import acquire.errors") if name.startswith("acquire")}
    assert ours == {
        "acquire",
        "acquire.errors",
        "acquire.text",
        "acquire.text.message",
        "acquire.text.quantity",
    }


ROOMS = ("burst", "camera", "hdf5", "load_cell", "opencv", "protocols", "serial_line", "session", "v4l2")


@pytest.mark.parametrize("room", ROOMS)
def test_a_room_loads_its_libraries_when_they_are_needed(room: str) -> None:
    heavy = {"cv2", "serial", "numba"} if room in ("hdf5", "session") else {"cv2", "serial", "numba", "h5py"}
    assert not loaded_by(f"import acquire.{room}") & heavy


def test_limits_of_opencv_stand_in_the_environment_before_it_is_loaded() -> None:
    code = (
        "import os; from acquire.cv2_loader import load_cv2; cv2 = load_cv2()\n"
        "print(*(os.environ['OPENCV_' + name] for name in ('IO_MAX_IMAGE_PIXELS', 'VIDEOIO_V4L_SELECT_TIMEOUT')),"
        " getattr(cv2.utils, 'logging', cv2).getLogLevel())"
    )
    plain = {key: value for key, value in os.environ.items() if not key.startswith("OPENCV_")}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, env=plain)
    assert done.stdout.split() == ["268435456", "1", "0"], done.stderr
