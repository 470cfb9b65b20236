"""OpenCV's limits hold only where ``load_cv2`` is the first to import it."""

from __future__ import annotations

import ast
import subprocess
import sys
import zlib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
READERS = {
    "images": "from acquire.opencv import read_image as read",
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
    assert f"{path}: " in told and "not a" in told, done.stderr
    assert int(taken_kB) < 1_000_000
