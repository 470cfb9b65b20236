"""Room on a disk, how long it lasts, and whether it is a disk at all."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from acquire.hdf5.disk import forecast, free_bytes, network_share


def test_free_bytes_of_what_does_not_exist_yet(tmp_path: Path) -> None:
    assert free_bytes(tmp_path / "a" / "b" / "session.h5") > 0


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


@pytest.mark.parametrize(
    ("path", "kind"),
    [
        ("/home/me/runs", None),
        ("/mnt/lab", "nfs4"),
        ("/mnt/lab/runs/session.h5", "nfs4"),
        ("/mnt/laboratory/runs", None),
        ("/mnt/my share/x", "cifs"),
        ("/mnt/lab/local/x", None),
    ],
)
def test_network_shares_are_known(tmp_path: Path, path: str, kind: str | None) -> None:
    mounts = tmp_path / "mounts"
    mounts.write_text(MOUNTS)
    assert network_share(path, mounts) == kind


def test_where_nobody_tells_the_mounts_nothing_is_known(tmp_path: Path) -> None:
    assert network_share(tmp_path, tmp_path / "nothing") is None
