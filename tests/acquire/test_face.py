"""What ``import acquire`` gives, and what it does not load."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


def loaded_by(statement: str) -> set[str]:
    """Modules in a fresh process after ``statement``."""
    code = f"{statement}\nimport sys\nprint(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, check=True)
    return set(done.stdout.split())


def test_the_errors_alone_load_no_room_and_no_library() -> None:
    ours = {name for name in loaded_by("import acquire.errors") if name.startswith("acquire")}
    assert ours == {"acquire", "acquire.errors"}


ROOMS = ("burst", "camera", "hdf5", "load_cell", "opencv", "protocols", "serial_line", "session", "v4l2")


@pytest.mark.parametrize("room", ROOMS)
def test_a_room_loads_its_libraries_when_they_are_needed(room: str) -> None:
    heavy = {"cv2", "serial", "numba"} if room in ("hdf5", "session") else {"cv2", "serial", "numba", "h5py"}
    assert not loaded_by(f"import acquire.{room}") & heavy
