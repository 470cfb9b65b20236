"""``phasedic run`` as a person starts it, and an indicator at the far end of the serial cable."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from types import TracebackType
from typing import Self

from tests.v4l2.inside.vivid import until

PORT, FAR_END = "/dev/ttyACM0", "/dev/ttyGS0"
USB = Path("/sys/bus/usb/devices/1-1/authorized")


class Indicator:
    """Sends the same force, ten times a second, whether or not somebody listens."""

    def __init__(self, force_N: float) -> None:
        self.force_N = force_N
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._send, name="indicator", daemon=True)

    def __enter__(self) -> Self:
        subprocess.run(["stty", "-F", FAR_END, "raw", "-echo"], check=True)
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._ended.set()
        self._thread.join(2)

    def _send(self) -> None:
        port = _open_far_end()
        while not self._ended.wait(0.1):
            try:
                os.write(port, b"%.2f N\r\n" % self.force_N)
            except BlockingIOError:  # nobody reads
                continue
            except OSError:  # the cable was pulled, which hangs this end up too
                os.close(port)
                port = _open_far_end()
        os.close(port)


def _open_far_end() -> int:
    return os.open(FAR_END, os.O_WRONLY | os.O_NONBLOCK | os.O_NOCTTY)


def unplug_serial() -> None:
    """Pull the USB cable of the indicator."""
    USB.write_text("0")


def plug_serial() -> None:
    """Put it back."""
    USB.write_text("1")


class Run:
    """A ``phasedic run`` of its own process; its words go into ``words.txt``."""

    def __init__(self, out: Path, camera: str, load: str, *more: str) -> None:
        self.out = out
        self._words = out.with_suffix(".txt")
        # faulthandler: one that does not end says where it stands
        argv = [
            sys.executable,
            "-X",
            "faulthandler",
            "-m",
            "live.cli",
            "run",
            "--camera",
            camera,
            "--load",
            load,
        ]
        argv += ["--out", str(out), *more]
        argv += ["--roi", "all", "--no-view", "--no-rrd"]
        with self._words.open("w") as words:
            self._process = subprocess.Popen(argv, stdout=words, stderr=subprocess.STDOUT)

    def words(self) -> str:
        """What it has said so far."""
        return self._words.read_text(errors="replace")

    def rows(self) -> list[str]:
        """Lines of strain.csv so far, without the heading."""
        tables = list(self.out.rglob("strain.csv"))
        if not tables:
            return []
        return [line for line in tables[0].read_text().splitlines() if line[:1].isdigit()]

    def until_rows(self, count: int, seconds: float = 400) -> None:
        """Wait until so many instants more are measured."""
        wanted = len(self.rows()) + count
        self.until(lambda: len(self.rows()) >= wanted, seconds)

    def until(self, condition: object, seconds: float = 240) -> None:
        """Wait for something while the run goes on."""

        def met() -> bool:
            assert self._process.poll() is None, f"the run has ended:\n{self.words()}"
            return bool(condition())  # type: ignore[operator]

        try:
            until(met, seconds)
        except AssertionError as error:
            raise AssertionError(f"{error}; {len(self.rows())} rows\n{self.words()[-3000:]}") from error

    def end(self) -> int:
        """Interrupt it as Ctrl-C does, and give its exit code.

        An emulated machine records more slowly than its camera goes: what waits is written first.
        """
        self._process.send_signal(signal.SIGINT)
        try:
            return self._process.wait(300)
        except subprocess.TimeoutExpired:
            self._process.send_signal(signal.SIGABRT)
            self._process.wait(10)
            raise AssertionError(f"still running 300 s after Ctrl-C:\n{self.words()}") from None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._process.kill()
        self._process.wait()


def pause(seconds: float) -> None:
    """Let the machine run on."""
    time.sleep(seconds)
