"""``phasedic page`` as a program, and a headless browser on its page."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from live.results.report.saving import find_browser
from tests.live.ui.waiting import LONG_S

ROOT = Path(__file__).parents[4]
FLAGS = ["--disable-gpu"]  # an emulated one takes twice the time, and nothing here draws with it
TIMEOUT_S = 240.0


def chromium() -> str:
    """The browser; the test is skipped without one, or without Playwright."""
    pytest.importorskip("playwright.sync_api")
    found = shutil.which("chromium") or find_browser()
    if found is None:
        pytest.skip("needs chromium")
    return str(found)


class Program:
    """``phasedic page`` in a folder of its own."""

    def __init__(self, folder: Path, *words: str) -> None:
        self._log = (folder / "err.txt").open("w")
        command = [sys.executable, "-m", "live.cli", *words]
        environment = {
            **os.environ,
            "PYTHONPATH": os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")]),
        }
        self.process = subprocess.Popen(
            command, cwd=folder, env=environment, stdout=subprocess.PIPE, stderr=self._log, text=True
        )
        self.output = ""
        self.address = self._address()

    def _address(self) -> str:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self.output += line
            if found := re.search(r"http://127\.0\.0\.1:\d+/\S+", line):
                return found[0]
        raise AssertionError(f"no page: {self.output}")

    @contextmanager
    def frozen(self) -> Iterator[None]:
        """Stop it for a while, as if it hung."""
        self.process.send_signal(signal.SIGSTOP)
        try:
            yield
        finally:
            self.process.send_signal(signal.SIGCONT)

    def end(self) -> int:
        """Wait for its end; kill it after ``LONG_S``."""
        try:
            self.output += self.process.communicate(timeout=LONG_S)[0]
        except subprocess.TimeoutExpired:
            self.kill()
        return self.process.returncode

    def kill(self) -> None:
        """Kill it where it still runs."""
        if self.process.poll() is None:
            self.process.kill()
            self.output += self.process.communicate()[0]
        self._log.close()


class Page:
    """A page of the browser with its requests and errors."""

    def __init__(self, page: Any) -> None:
        self.page = page
        self.address = ""
        self.requested: list[str] = []
        self.posted: list[dict[str, Any]] = []
        self.errors: list[str] = []
        page.on("request", self._request)
        page.on("pageerror", lambda error: self.errors.append(str(error)))
        page.on("console", self._logged)

    def _logged(self, message: Any) -> None:
        if message.type in ("error", "warning"):
            self.errors.append(message.text)

    def _request(self, request: Any) -> None:
        self.requested.append(request.url)
        if request.method == "POST":
            self.posted.append(json.loads(request.post_data))

    def until(self, holds: Callable[[], bool], what: str) -> None:
        """Wait until it holds."""
        end = time.monotonic() + TIMEOUT_S
        while not holds():
            if time.monotonic() > end:
                raise AssertionError(f"not within {TIMEOUT_S:g} s: {what}; {self.errors}")
            self.page.wait_for_timeout(100)

    def goto(self, address: str) -> None:
        """Open the page; the one that takes the token leads to it."""
        self.page.goto(address)
        self.page.wait_for_selector("#language", state="attached")

    def text(self, id_: str) -> str:
        """The text of an element."""
        return str(self.page.text_content(f"#{id_}"))

    def stage(self) -> str:
        """The stage that the page shows."""
        return str(self.page.get_attribute("body", "data-stage"))

    def step(self, name: str) -> None:
        """Open a step of the set-up."""
        if self.page.get_attribute(f"#step-{name}", "open") is None:
            self.page.click(f"#step-{name} > summary")

    def press(self, key: str) -> None:
        """Press a key when that is neither a bounce nor too soon after a change of the stage."""
        self.page.wait_for_timeout(350)
        self.until(lambda: not self.page.locator("body.pausing").count(), "the pause is over")
        self.page.keyboard.press(key)

    def armed(self) -> bool:
        """Whether a button waits for its second press."""
        return bool(self.page.locator(".button.armed").count())

    def confirm(self) -> None:
        """Press what was armed again, as soon as that counts."""
        self.until(self.armed, "a button is armed")
        self.page.wait_for_timeout(600)
        self.page.click(".button.armed")

    def on_screen(self, points: list[tuple[float, float]]) -> list[tuple[float, float]]:
        """Positions of the picture, px, as positions of the mouse."""
        script = """points => { const m = document.getElementById("drawing").getScreenCTM();
            return points.map(([x, y]) => { const p = new DOMPoint(x, y).matrixTransform(m); return [p.x, p.y]; }); }"""
        return [tuple(p) for p in self.page.evaluate(script, points)]

    def drag(self, *points: tuple[float, float]) -> None:
        """Press the mouse, move it along positions of the picture, and release it."""
        first, *others = self.on_screen(list(points))
        mouse = self.page.mouse
        mouse.move(*first)
        mouse.down()
        for position in others:
            mouse.move(*position, steps=4)
        mouse.up()

    def click(self, *points: tuple[float, float]) -> None:
        """Click positions of the picture."""
        for position in self.on_screen(list(points)):
            self.page.mouse.click(*position)
