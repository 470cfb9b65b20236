"""Ctrl-C and SIGTERM: what they do to a command and all its processes, in its first moments and later."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from acquire.errors import Interrupted
from acquire.system import signal_handler
from analysis import PICTURE_KINDS, share_compiled
from live.pipeline.consumer import Screen
from live.setup.compiling import compile_ahead
from tests.bench.soak import children
from tests.live.ui.waiting import until

ROOT = Path(__file__).parents[3]
CAMERA = "sim:uniform?seconds=60&fps=20&width=160&height=128"


def interrupted(
    folder: Path, words: str, ready: Callable[[subprocess.Popen[str]], bool]
) -> tuple[int, str, float]:
    """The command gets Ctrl-C with all of its group once it is ``ready``: exit code, words, and seconds since."""
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(folder / "cache"), "PYTHONPATH": str(ROOT)}
    with (folder / "output.txt").open("w+", encoding="utf-8") as output:
        process = subprocess.Popen(
            [sys.executable, "-m", "live.cli", *words.split()], cwd=folder, env=environment, stdout=output,
            stderr=subprocess.STDOUT, text=True, process_group=0,
        )  # fmt: skip
        while not ready(process):
            assert process.poll() is None, (folder / "output.txt").read_text(encoding="utf-8")
            time.sleep(0.01)
        os.killpg(process.pid, signal.SIGINT)
        began = time.monotonic()
        code = process.wait(60)
    return code, (folder / "output.txt").read_text(encoding="utf-8"), time.monotonic() - began


@pytest.mark.slow
@pytest.mark.timed
@pytest.mark.parametrize(
    "words",
    [f"run --camera {CAMERA} --no-view --no-rrd --out out", "batch run/session.h5 --out out --workers 1"],
)
def test_while_the_loops_are_compiled(tmp_path: Path, words: str) -> None:
    """The first start on a machine: a minute in which nobody knows yet what it does."""
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "session.h5").write_bytes(b"nothing of a session")

    def compiling(process: subprocess.Popen[str]) -> bool:
        return any("live.setup" in command_of(pid) for pid in children(process.pid))

    code, output, seconds = interrupted(tmp_path, words, compiling)
    assert code == 130, output
    assert "interrupted while the loops were compiled" in output
    assert "Traceback" not in output
    assert "everything is compiled" not in output
    assert "could not be kept" not in output
    assert seconds < 20, "it went on compiling"


def command_of(pid: int) -> str:
    try:
        return Path(f"/proc/{pid}/cmdline").read_text(encoding="utf-8").replace("\0", " ")
    except OSError:
        return ""


@pytest.mark.slow
@pytest.mark.timed
def test_while_workers_load(tmp_path: Path) -> None:
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "session.h5").write_bytes(b"nothing of a session")

    def loading(process: subprocess.Popen[str]) -> bool:
        return any("live.replay.batch.worker" in command_of(pid) for pid in children(process.pid))

    code, output, seconds = interrupted(tmp_path, "batch run/session.h5 --out out --workers 2", loading)
    assert code == 130, output
    assert "Traceback" not in output
    assert seconds < 20, "it compiled first"


def never_ending(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is compiled, and compiling takes for ever."""
    monkeypatch.setattr("analysis.not_compiled", lambda kinds, phase: True)
    begin = subprocess.Popen
    sleep = [sys.executable, "-c", "import time; time.sleep(60)"]
    monkeypatch.setattr(subprocess, "Popen", lambda command, **more: begin(sleep, **more))


class Killing(Screen):
    """Sends this process a signal once there is something to show."""

    def __init__(self, number: signal.Signals) -> None:
        self._number = number

    def status(self, text: str) -> None:
        os.kill(os.getpid(), self._number)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_whoever_handles_a_signal_hears_of_it(
    monkeypatch: pytest.MonkeyPatch, number: signal.Signals
) -> None:
    never_ending(monkeypatch)
    heard: list[int] = []
    before = signal.signal(number, lambda number, frame: heard.append(number))
    try:
        with pytest.raises(Interrupted, match="what is compiled is kept"):
            compile_ahead(("uint8",), screen=Killing(number))
        assert heard == [number]
        signal.raise_signal(number)
        assert heard == [number, number], "the handler is not back"
    finally:
        signal.signal(number, before)


def test_ctrl_c_in_a_command_without_a_handler(monkeypatch: pytest.MonkeyPatch) -> None:
    """As ``demo`` and ``warm-up``: it says what is kept."""
    never_ending(monkeypatch)
    # Python's own handler: a shell that starts the tests in the background has SIGINT ignored.
    handler = signal_handler(signal.default_int_handler, signal.SIGINT)
    with handler, pytest.raises(Interrupted, match="what is compiled is kept"):
        compile_ahead(("uint8",), screen=Killing(signal.SIGINT))


def test_it_was_stopped_before(monkeypatch: pytest.MonkeyPatch) -> None:
    never_ending(monkeypatch)
    with pytest.raises(Interrupted):
        stopping = threading.Event()
        stopping.set()
        compile_ahead(("uint8",), stopping=stopping)


def test_a_process_that_was_interrupted_ends_the_other(monkeypatch: pytest.MonkeyPatch) -> None:
    """As where a thread of the page compiles, which no signal reaches."""
    monkeypatch.setattr("analysis.not_compiled", lambda kinds, phase: True)
    begin, made = subprocess.Popen, list[subprocess.Popen[bytes]]()
    let = "import signal as s, time; s.signal(s.SIGINT, s.SIG_DFL); s.pthread_sigmask(s.SIG_UNBLOCK, [s.SIGINT])"

    def start(command: list[str], **more: object) -> subprocess.Popen[bytes]:
        made.append(begin([sys.executable, "-c", f"{let}; time.sleep(60)"], **more))
        return made[-1]

    monkeypatch.setattr(subprocess, "Popen", start)
    threading.Thread(
        target=lambda: (until(lambda: len(made) == 2), made[0].send_signal(signal.SIGINT))
    ).start()
    with pytest.raises(Interrupted):
        compile_ahead(("uint8",))
    assert [process.returncode for process in made] == [-signal.SIGINT, -signal.SIGTERM]


def test_the_share_that_is_compiled() -> None:
    """Everything was compiled since 1970, and nothing will have been in an hour."""
    compile_ahead(PICTURE_KINDS, phase=True)
    assert share_compiled(PICTURE_KINDS, 0.0, phase=True) == 1.0
    assert share_compiled(PICTURE_KINDS, time.time() + 3600, phase=True) == 0.0


GIVEN = """
import os, signal, sys
from live.commands.process import signals
from live.pipeline.consumer import Screen
stops, screen = [], Screen()
screen.print = lambda line: print(line, flush=True)
with signals(lambda: stops.append(1), screen):
    for _ in range(int(sys.argv[1])):
        signal.raise_signal(signal.SIGTERM)
print(len(stops), "stops", flush=True)
"""


def given(times: int) -> tuple[int, str]:
    done = subprocess.run(
        [sys.executable, "-c", GIVEN, str(times)], env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True, text=True, timeout=60, check=False,
    )  # fmt: skip
    return done.returncode, done.stdout


def test_the_first_two_signals_close_and_the_third_ends_at_once() -> None:
    code, output = given(2)
    assert (code, output.splitlines()[-1]) == (0, "2 stops")
    assert "closing the files ..." in output and "a third signal ends it at once" in output
    code, output = given(3)
    assert code == -15 and "stops" not in output
