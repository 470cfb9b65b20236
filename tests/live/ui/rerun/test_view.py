"""The process of the view: it draws everything, is restarted when it ends, and never delays the test."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import textwrap
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from acquire.events import Event, EventKind
from live.ui.rerun import supervisor
from live.ui.rerun.view import View, url
from tests.live.made_up import START, make_frame, make_measurement
from tests.live.ui.rerun.test_drawing import make_setup, rows_in
from tests.live.ui.waiting import LONG_S, until


class ViewRecord:
    """A view with its messages, and how often it was served."""

    def __init__(self, port: int | None, rrd: Path | None, **more: Any) -> None:
        self.messages: list[str] = []
        self.served: list[int | None] = []
        self.view = View(
            make_setup(**more),
            port=port,
            rrd=rrd,
            notify=lambda text, level: self.messages.append(f"{level}: {text}"),
            on_serving=lambda view: self.served.append(view.port),
        )

    def close(self) -> None:
        self.view.close(LONG_S)


@pytest.fixture
def make() -> Iterator[Callable[..., ViewRecord]]:
    made: list[ViewRecord] = []

    def make(port: int | None, rrd: Path | None, **more: Any) -> ViewRecord:
        made.append(ViewRecord(port, rrd, **more))
        return made[-1]

    yield make
    for watched in made:
        watched.close()


def show(view: View, first: int = 0, count: int = 30) -> None:
    view.event(Event(START, EventKind.START, "phasedic", "test started"))
    view.status("**E** 70 GPa")
    for k in range(first, first + count):
        view.picture(make_frame(k, START + 0.1 * k))
        for j in range(10):
            view.load(START + 0.1 * k + 0.01 * j, 10.0 * k)
        view.show(make_measurement(k, 1e-4 * k))
        view.point(1e-4 * k, 10.0 * k)


def is_gone(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return True
    # An orphan that nobody reaps stays as a zombie.
    return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] == "Z"


def test_the_file_contains_what_was_shown(make: Callable[..., ViewRecord], tmp_path: Path) -> None:
    watched = make(None, tmp_path / "view.rrd", area_m2=4e-5)
    show(watched.view)
    watched.close()
    assert (watched.view.failed, watched.messages) == ("", [])
    assert watched.view.instructions.startswith("later: ")
    rows = rows_in(tmp_path / "view.rrd")
    static = 1
    assert rows["/strain/eyy"] == 30 + static  # every mean, however many fields were passed over
    assert rows["/load/force"] == 150 + static  # 50 a second
    assert rows["/curve/line"] >= 1
    assert rows["/events"] == rows["/status"] == 1
    assert "pictures drawn" in watched.view.report
    assert "dropped" not in watched.view.report
    assert watched.view.pid is None


def test_it_serves_on_the_next_port_when_the_wanted_one_is_taken(make: Callable[..., ViewRecord]) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        wanted = taken.getsockname()[1]
        both = [make(wanted, None), make(wanted, None)]
        until(lambda: all(watched.served for watched in both))
    ports = {watched.view.port for watched in both}
    assert len(ports) == 2
    assert wanted not in ports
    for watched in both:
        assert f"port {wanted} is taken" in watched.messages[0]
        assert url(watched.view.port or 0) in watched.view.instructions


@pytest.mark.slow
def test_killed_it_is_restarted_on_its_port_with_the_past_data(
    make: Callable[..., ViewRecord], tmp_path: Path
) -> None:
    watched = make(0, tmp_path / "view.rrd")
    view = watched.view
    until(lambda: watched.served)
    show(view)
    until(lambda: not view.report.startswith("0 maps"))
    os.kill(view.pid or 0, signal.SIGKILL)
    until(lambda: len(watched.served) == 2)
    show(view, first=30)
    watched.close()
    assert watched.served[0] == watched.served[1]
    assert watched.messages == ["warning: the view's process was ended by SIGKILL and is restarted"]
    assert view.rrd == tmp_path / "view-2.rrd"
    assert rows_in(tmp_path / "view-2.rrd")["/strain/eyy"] == 60 + 1
    assert "started 2 times" in view.report


@pytest.mark.slow
@pytest.mark.timed
def test_stopped_it_is_replaced_and_delays_nothing(
    make: Callable[..., ViewRecord], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        supervisor, "STUCK_S", 2.0
    )  # a busy machine may keep the new one waiting for a second
    watched = make(None, tmp_path / "view.rrd")
    until(lambda: watched.served)
    stopped = watched.view.pid or 0
    os.kill(stopped, signal.SIGSTOP)
    longest, k = 0.0, 0
    while not watched.messages:
        begin = time.perf_counter()
        watched.view.picture(make_frame(k, START + 0.2 * k, (1024, 1280)))
        watched.view.show(make_measurement(k))
        longest = max(longest, time.perf_counter() - begin)
        k += 1
        time.sleep(0.01)
    until(lambda: len(watched.served) == 2)
    watched.close()
    assert longest < 1.0
    assert is_gone(stopped)
    assert watched.messages == [
        "warning: the view's process took nothing for 2 s (stopped?) and is restarted"
    ]
    assert rows_in(tmp_path / "view-2.rrd")["/strain/eyy"] == k + 1


@pytest.mark.slow
def test_at_the_end_a_stopped_one_is_killed_and_reported(
    make: Callable[..., ViewRecord], tmp_path: Path
) -> None:
    watched = make(None, tmp_path / "view.rrd")
    until(lambda: watched.served)
    stopped = watched.view.pid or 0
    os.kill(stopped, signal.SIGSTOP)
    watched.view.close(0.3)
    assert is_gone(stopped)
    assert len(watched.messages) == 1
    assert "did not finish in time" in watched.messages[0]


PARENT = """
    import time
    from pathlib import Path
    from tests.live.ui.rerun.test_view import ViewRecord, show

    watched = ViewRecord(None, Path("view.rrd"))
    show(watched.view)
    while watched.view.report.startswith("0 maps"):
        time.sleep(0.02)
    print(watched.view.pid, flush=True)
    time.sleep(600)
"""


@pytest.mark.slow
def test_it_ends_with_the_test_however_that_ends(tmp_path: Path) -> None:
    code = textwrap.dedent(PARENT)
    root = str(Path(__file__).parents[4])
    with subprocess.Popen(
        [sys.executable, "-c", code],
        stdout=subprocess.PIPE,
        text=True,
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": root},
    ) as parent:
        child = int(parent.stdout.readline())
        os.kill(child, signal.SIGINT)
        os.kill(child, signal.SIGHUP)
        assert not is_gone(child)
        parent.kill()
    until(lambda: is_gone(child))
    assert rows_in(tmp_path / "view.rrd")["/strain/eyy"] > 1


def test_a_file_that_exists_is_not_overwritten(make: Callable[..., ViewRecord], tmp_path: Path) -> None:
    path = tmp_path / "view.rrd"
    path.write_text("precious")
    watched = make(None, path)
    until(lambda: watched.view.failed)
    assert "exists already and is not overwritten" in watched.view.failed
    assert watched.messages == [f"warning: {watched.view.failed}"]
    assert watched.view.rrd is None
    assert path.read_text() == "precious"


def test_one_that_cannot_start_is_given_up(
    make: Callable[..., ViewRecord], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(supervisor, "MAX_STARTS", 2)
    monkeypatch.setenv("PYTHONHOME", "/nowhere")
    watched = make(0, None)
    until(lambda: watched.view.failed)
    assert "does not start (ended with 1)" in watched.view.failed
    assert len(watched.messages) == 1


@pytest.mark.parametrize("word", ["off", "OFF", "0", "no"])
def test_with_rerun_off_one_sentence_says_so_and_nothing_is_started(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, word: str
) -> None:
    monkeypatch.setenv("RERUN", word)
    said: list[str] = []
    off = View(make_setup(), port=0, rrd=tmp_path / "view.rrd", notify=lambda text, level: said.append(text))
    show(off)
    off.close(1.0)
    assert said == ["RERUN=off is set: the view stays empty, and view.rrd too; unset the variable"]
    assert off.pid is None and off.port is None and not off.failed and not list(tmp_path.iterdir())
