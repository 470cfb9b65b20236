"""What ``recover`` saves of a session that was killed, damaged or cut."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from acquire.errors import DataError
from acquire.record_mode import RecordMode
from acquire.session import Session, recover
from tests.acquire.session.fixtures import CAMERA, frame, sample, writer


def abandoned(path: Path, frames: int = 6) -> Path:
    """A copy of a file whose writer is still at it: what a kill leaves behind."""
    with writer(path.with_name("alive.h5")) as session:
        for k in range(frames):
            session.write_load(sample(k))
            session.write_frame(frame(k))
        session.flush()
        path.write_bytes(session.path.read_bytes())
    return path


def test_an_abandoned_file_opens_and_says_so(tmp_path: Path) -> None:
    path = abandoned(tmp_path / "killed.h5")
    with Session.open(path) as back:
        assert back.recovered is not None and "not closed by its writer" in back.recovered
        assert len(back) == 6 and len(back.load_samples()) == 6
        np.testing.assert_array_equal(back.frame(5).image, frame(5).image)


def test_recover_makes_a_clean_copy(tmp_path: Path) -> None:
    path = abandoned(tmp_path / "killed.h5")
    before = path.read_bytes()
    done = recover(path)
    assert (done.frames, done.load_samples, done.unreadable) == (6, 6, ())
    assert done.path.name == "killed.recovered.h5" and path.read_bytes() == before
    with Session.open(done.path) as back:
        assert back.recovered is None and back.ledger is None
        assert back.indices.tolist() == [5, 6, 7, 8, 9, 10]
        assert back.metadata == {"operator": "Zoé"}
        assert "copied from killed.h5" in back.events()[-1].text
    with pytest.raises(DataError, match="not overwritten"):
        recover(path)


def test_a_frame_that_cannot_be_read_becomes_a_counted_loss(tmp_path: Path) -> None:
    path = tmp_path / "session.h5"
    with writer(path) as session:
        for k in range(4):
            session.write_frame(frame(k))
        session.write_ledger({"grabbed": 4})
    with Session.open(path) as back:
        chunk = back._parts[0].entry["frames/image"].id.get_chunk_info(1)
    content = bytearray(path.read_bytes())
    content[chunk.byte_offset + 10] ^= 0xFF
    path.write_bytes(content)
    with Session.open(path) as back, pytest.raises(DataError, match="frame 1 cannot be read"):
        list(back.frames())
    done = recover(path, tmp_path / "clean.h5")
    assert done.frames == 3 and len(done.unreadable) == 1 and "1 things could not be read" in done.line()
    with Session.open(done.path) as back:
        assert [f.lost_before for f in back.frames()] == [0, 1, 0]
        assert back.ledger == {"grabbed": 4}


def test_a_cropped_session_keeps_its_crop(tmp_path: Path) -> None:
    path = tmp_path / "session.h5"
    with writer(path, mode=RecordMode("every", 2, (3, 2, 8, 5))) as session:
        session.write_frame(frame(0))
    done = recover(path)
    with Session.open(done.path) as back:
        assert back.mode == RecordMode("every", 2, (3, 2, 8, 5))
        assert back.camera.width == 8 and CAMERA.width == 16
        np.testing.assert_array_equal(back.frame(0).image, frame(0).image[2:7, 3:11])


def test_what_is_no_session_cannot_be_recovered(tmp_path: Path) -> None:
    path = tmp_path / "notes.h5"
    path.write_text("notes")
    with pytest.raises(DataError, match="not an HDF5 file"):
        recover(path)
    assert list(tmp_path.iterdir()) == [path]
