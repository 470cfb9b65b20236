"""Parts of tasks: whose process is gone they are stale, also where nobody has reaped it."""

from __future__ import annotations

import platform
import subprocess
import sys
import time
from pathlib import Path

import pytest

from live.batch.work.places import parts, sweep


@pytest.mark.skipif(sys.platform != "linux", reason="zombies are told by /proc")
def test_the_part_of_a_zombie_is_stale(tmp_path: Path) -> None:
    with subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE) as child:
        host = platform.node().replace(".", "-") or "host"
        (tmp_path / f".one.{host}.{child.pid}.part").mkdir()
        assert not sweep(tmp_path)  # it lives
        child.kill()
        state = Path(f"/proc/{child.pid}/stat")
        while state.read_text().rpartition(")")[2].split()[0] != "Z":
            time.sleep(0.01)
        assert sweep(tmp_path) == 1
    assert not list(parts(tmp_path))
