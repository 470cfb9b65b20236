"""A disk that takes no more: the recording ends in words, and what was complete is readable.

The limit on the size of files stands in for the full disk: writing fails in the same place.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from acquire.errors import DataError
from acquire.session import Session
from tests.acquire.session.fixtures import frame, writer

CHILD = """
import resource, sys
from pathlib import Path
from acquire.errors import DataError
from tests.acquire.session.fixtures import frame, sample, writer
session = writer(Path(sys.argv[1]))
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[2]), resource.RLIM_INFINITY))
for number in range(10_000):
    try:
        session.write_load(sample(number))
        session.write_frame(frame(number))
        if number % 4 == 3:
            session.flush()
    except DataError as error:
        print(number - session.unflushed_frames)
        print(error)
        break
try:
    session.write_frame(frame(number))
except DataError as error:
    print(error)
session.close()
"""


@pytest.mark.parametrize("limit", [150_000, 200_123, 299_999])
def test_all_flushed_frames_are_readable(tmp_path: Path, limit: int) -> None:
    path = tmp_path / "session.h5"
    child = subprocess.run(
        [sys.executable, "-c", CHILD, str(path), str(limit)], capture_output=True, text=True, timeout=60
    )
    assert child.returncode == 0, child.stderr
    number, why, after = child.stdout.splitlines()
    assert "stays readable" in why and str(path) in why
    assert "closed" in after
    with Session.open(path) as back:
        assert back.recovered is not None
        assert len(back) >= int(number) > 0
        for k in range(int(number)):
            np.testing.assert_array_equal(back.frame(k).image, frame(k).image)


def test_a_folder_that_may_not_be_written(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="choose a folder that exists and is writable"):
        writer(Path("/proc/session.h5"))
