"""Pages that stop reading, or are killed, during a real run: no result changes, and they take next to no time."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import h5py
import numpy as np
import pytest

from live.config.loading import load_config
from live.stream.adapted import Adapted
from live.stream.stream import Matched
from live.ui.web.broadcaster import MAX_PAGES
from live.ui.web.page_controller import PageController
from tests.live.streaming import record_of
from tests.live.ui.waiting import until
from tests.live.ui.web.browser import Program
from tests.live.ui.web.http_page import HttpPage
from tests.live.ui.web.test_page_values import pictured

ROOT = Path(__file__).parents[4]
CAMERA = "sim:uniform?width=256&height=192&fps=20&seconds=5"
RUN = f"run --page --camera {CAMERA} --load sim: --no-view --no-rrd --out out --zoi 32 --burst 2".split()
TIMINGS = ("latency_s", "kernel_s")  # of the machine, not of the specimen


def numbers(folder: Path) -> dict[str, np.ndarray]:
    """All results in strain.h5: maps, and means with their uncertainties."""
    with h5py.File(folder / "strain.h5") as file:
        found = {}
        for group in ("entry/strain", "entry/mean"):
            items = file[group].items()
            found |= {f"{group}/{name}": item[()] for name, item in items if name not in TIMINGS}
        return found


def ended_well(program: Program) -> None:
    """A busy machine may lose frames of the simulated camera, with a page or without; all else is in order."""
    code, output = program.end(), program.output
    assert code == 0 or (code == 5 and "lost, the last before frame" in output), output
    assert "every frame is accounted for" in output and "STOPPED" not in output


def assert_untouched(folder: Path) -> None:
    """The results are those of a replay, where no page was.

    In a process of its own, as the run was: one that has compiled loops may get another last digit.
    """
    again = folder.with_name("again")
    arguments = ["replay", str(folder / "session.h5"), "--as-measured", "--out", str(again)]
    command = [sys.executable, "-m", "live.cli", *arguments, "--no-view", "--no-rrd"]
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True)
    with_page, without = numbers(folder), numbers(again)
    assert len(with_page["entry/mean/eyy"]) > 20 and with_page.keys() == without.keys()
    for name, values in with_page.items():
        np.testing.assert_array_equal(values, without[name], err_msg=name)


@pytest.fixture
def program(tmp_path: Path) -> Iterator[Program]:
    started = Program(tmp_path, *RUN)
    yield started
    started.kill()


@pytest.mark.slow
def test_pages_that_are_killed_or_do_not_read_change_no_result(program: Program, tmp_path: Path) -> None:
    pages = [HttpPage(program.address) for _ in range(MAX_PAGES // 2)]
    for size in (20_000, 1, 0, 1000):  # the last, a later page, gets everything too
        page = HttpPage(program.address)
        page.read(size)
        page.kill()
    ended_well(program)
    for page in pages:
        assert b"event: gone" not in page.rest(), "it read nothing"
    assert_untouched(tmp_path / "out")


@pytest.mark.timed
def test_eight_pages_that_do_not_read_cost_under_a_millisecond_a_measurement() -> None:
    """In the time of the thread that measures: another busy program is not the page's doing."""
    config, m, costs = load_config(None, {}), pictured(), []
    with PageController(None, port=0) as controller:
        watching = controller.begin({"": config})[""]
        worker = Adapted(watching, lambda *told: pytest.fail(str(told)))
        worker.start()
        pages = [HttpPage(controller.address) for _ in range(MAX_PAGES)]
        streams = list(controller._broadcaster._subscribers)
        controller._broadcaster.publish("large", "x" * 200_000)
        until(lambda: all(stream._waiting for stream in streams))  # they are blocked
        for _ in range(200):
            began = time.thread_time()
            worker.take(record_of(m))
            worker.take(record_of(Matched(m)))
            costs.append(time.thread_time() - began)
            time.sleep(0.002)
        assert len(streams) == MAX_PAGES and all(stream._waiting for stream in streams)
        worker.end()
        for page in pages:
            page.kill()
    assert np.percentile(costs, 95) < 1e-3
