"""What surrounds a command: streams, environment, help, and what a batch or a recovery is told."""

from __future__ import annotations

import argparse
import io
import threading
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace

import pytest

from acquire.errors import ConfigError
from live.commands import process, recover
from live.commands.options import add_options
from live.commands.process import NonBlockingStream
from live.config.loading import load_config
from tests.live.ended import code_of


class Slow(io.StringIO):
    """A terminal that is stopped until it is let go."""

    def __init__(self) -> None:
        super().__init__()
        self.began, self.go = threading.Event(), threading.Event()

    def write(self, text: str) -> int:
        self.began.set()
        self.go.wait()
        return super().write(text)

    def fileno(self) -> int:
        raise OSError


def test_a_stopped_terminal_loses_writes_and_says_how_many() -> None:
    slow = Slow()
    stream = NonBlockingStream(slow, 3)
    stream.write("first")
    assert slow.began.wait(10)
    for k in range(5):
        assert stream.write(str(k)) == 1
    assert not stream.drain(0.001) and not stream.isatty()
    slow.go.set()
    assert stream.drain(10)
    stream.write("last")
    assert stream.drain(10) and slow.getvalue() == "first012(2 writes left out: nobody read them)\nlast"
    with pytest.raises(OSError):
        stream.fileno()


def test_streams_are_given_back(monkeypatch: pytest.MonkeyPatch) -> None:
    out = io.StringIO()
    monkeypatch.setattr(process.sys, "stdout", out)
    with process.nonblocking_streams():
        print("a line")
        assert process.sys.stdout is not out
    assert process.sys.stdout is out and out.getvalue() == "a line\n"


@pytest.mark.parametrize(("name", "value", "well"), [
    ("NUMBA_NUM_THREADS", "1", True), ("NUMBA_NUM_THREADS", "0", False), ("NUMBA_NUM_THREADS", "2.5", False),
    ("SOURCE_DATE_EPOCH", "0", True), ("SOURCE_DATE_EPOCH", "-1", False), ("NUMBA_NUM_THREADS", "²", False),
    ("NUMBA_NUM_THREADS", "", False), ("SOURCE_DATE_EPOCH", "", False), ("SOURCE_DATE_EPOCH", "x", False),
])  # fmt: skip
def test_whole_numbers_of_the_environment(
    monkeypatch: pytest.MonkeyPatch, name: str, value: str, well: bool
) -> None:
    monkeypatch.setenv(name, value)
    words = f"{name}=.* is not possible; give a whole number from"
    with nullcontext() if well else pytest.raises(ConfigError, match=words):
        process.check_environment()


def test_one_thread_of_openblas_unless_the_user_says_another(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("OPENBLAS_NUM_THREADS", raising=False)
    process.limit_resources()
    assert process.os.environ["OPENBLAS_NUM_THREADS"] == "1"
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "3")
    process.limit_resources()
    assert process.os.environ["OPENBLAS_NUM_THREADS"] == "3"


@pytest.mark.parametrize(("unreadable", "code"), [(0, 0), (3, 5), (12, 5)])
def test_ten_losses_of_a_recovery_are_named(
    monkeypatch: pytest.MonkeyPatch, unreadable: int, code: int
) -> None:
    sentences = [f"loss {k}" for k in range(unreadable)]
    done = SimpleNamespace(unreadable=sentences, line=lambda: "12 frames")
    monkeypatch.setattr("acquire.session.recover", lambda session, out: done)
    said: list[str] = []
    assert recover.command(argparse.Namespace(session="a.h5", out=None), said.append) == code
    assert said == ["12 frames", *(f"  {one}" for one in sentences[:10])]


def test_the_help_names_the_defaults_there_are() -> None:
    parser = argparse.ArgumentParser()
    add_options(parser, "group", "zoi", "mask", "no-view", "order")
    helps = {action.dest: str(action.help) for action in parser._actions}
    defaults = load_config(None, {}).measure
    assert helps["measure.zoi"].endswith(f"(default {defaults.zoi})")
    assert helps["measure.order"].endswith(f"(default {defaults.order})")
    assert "default" not in helps["measure.mask"] and helps["view.enabled"].startswith("do not ")
    found = parser.parse_args(["--zoi", "40", "--no-view"])
    assert getattr(found, "measure.zoi") == 40 and getattr(found, "view.enabled") is False
    assert getattr(found, "measure.mask") is None


@pytest.mark.parametrize(
    ("words", "said"),
    [
        *((["--chunk", chunk], "above 0") for chunk in ("0", "-1", "inf", "nan", "some")),
        (["--chunk", "0.5", "--as-measured"], "--as-measured is bit-identical"),
        (["--workers", "0"], "from 1"),
    ],
)
def test_chunks_and_workers_of_a_batch(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], words: list[str], said: str
) -> None:
    code = code_of(["batch", "x", "--out", str(tmp_path / "out"), *words])
    assert code == 2 and said in capsys.readouterr().err
