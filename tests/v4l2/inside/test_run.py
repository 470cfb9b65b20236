"""``phasedic run`` on the kernel's camera and serial cable: known motion, and faults in mid-test."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from acquire.session.reader import Session
from tests.v4l2.inside import running, vivid
from tests.v4l2.prepare import MEASURED

LOAD = "/dev/ttyACM0?protocol=ascii&baud=115200&unit=N"


@pytest.mark.v4l2
@pytest.mark.parametrize(("fourcc", "bits"), [("GREY", 8), ("Y12", 12)])
def test_a_known_motion_is_measured_end_to_end(
    kept: Path, tmp_path: Path, pictures: dict[str, NDArray[Any]], fourcc: str, bits: int
) -> None:
    """Reference, shift, strain on the screen; what was recorded is measured outside as well."""
    camera = f"/dev/video0?input=1&format={fourcc}"
    with (
        vivid.looped(fourcc, pictures[f"reference_{bits}"], fps=50) as screen,
        running.Indicator(10.0) as indicator,
        running.Run(tmp_path / f"motion_{bits}", camera, LOAD, *MEASURED) as run,
    ):
        run.until_rows(3)
        screen.show(pictures[f"shifted_{bits}"])
        indicator.force_N = 20.0
        run.until_rows(6)
        screen.show(pictures[f"strained_{bits}"])
        indicator.force_N = 30.0
        run.until_rows(6)
        code = run.end()
    assert code in (130, 5), run.words()
    shutil.copytree(run.out, kept / run.out.name)
    with Session.open(next(run.out.rglob("session.h5"))) as session:
        assert np.array_equal(session.frame(len(session) - 1).image, pictures[f"strained_{bits}"])
        assert {round(sample.force) for sample in session.load_samples()} <= {10, 20, 30}
    shutil.rmtree(run.out)  # it lies in the memory of the machine, which the next recording needs


@pytest.mark.v4l2
def test_camera_and_load_cell_unplugged_in_mid_test(tmp_path: Path) -> None:
    camera = "/dev/video0?format=GREY&width=640&height=360&fps=5"
    small = ("--zoi", "64", "--step", "64", "--burst", "2", "--reference-burst", "4")
    with running.Indicator(55.0), running.Run(tmp_path / "faults", camera, LOAD, *small) as run:
        run.until_rows(2)
        vivid.unplug()
        run.until(lambda: "unplugged" in run.words())
        running.pause(2)
        vivid.plug()
        run.until(lambda: "opened again" in run.words())
        running.unplug_serial()
        run.until(lambda: "lost" in run.words().rpartition("opened again")[2])
        running.pause(2)
        running.plug_serial()
        run.until(lambda: "connected again" in run.words())
        run.until_rows(3)
        code = run.end()
    assert code in (130, 5), run.words()
    with Session.open(next(run.out.rglob("session.h5"))) as session:
        numbers = np.array(session.indices)
        assert (np.diff(numbers) > 0).all()
        assert np.diff(numbers).max() > 3  # the counted gap
        frames = list(session.frames())
        assert max(frame.lost_before for frame in frames) > 3
        times = np.array([sample.t for sample in session.load_samples()])
        assert np.diff(times).max() > 2  # the load was away ...
        away = times[np.diff(times).argmax()]
        assert any(away < frame.t < away + 2 for frame in frames)  # ... which stopped no image ...
        assert frames[-1].t - times[-1] < 3  # ... and came back
        told = " ".join(event.text for event in session.events())
        frame_counts = session.frame_counts
    for words in ("unplugged", "opened again", "connected again"):
        assert words in told
    assert frame_counts is not None
