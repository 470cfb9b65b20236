"""The pictures of page, report and display: ``python -m docs.make_page_pictures`` (chromium, playwright, pillow).

A simulated test, set up and run by mouse and keyboard in a headless browser; and a demo with report and display.
"""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from PIL import Image
from playwright.sync_api import sync_playwright

from docs.make_rig_pictures import report
from live.ui.rerun.view import rerun_command
from tests.live.ui.web.browser import FLAGS, Page, Program, chromium

IMAGES = Path(__file__).parent / "images"
CAMERA = "sim:woven?fps=15&seconds=44&hold=8&buffers=64&px_per_mm=20"
COLOURS = 256
WIDE = 960  # px in the documents
AT = 0.72
"""The time of the picture of the display, of that of the test."""


def main(folder: Path, size: tuple[int, int] = (1280, 800), dark: bool = False) -> int:
    """Write the pictures into ``folder``."""
    with sync_playwright() as driver, TemporaryDirectory() as work:
        browser = driver.chromium.launch(
            executable_path=chromium(), headless=True, chromium_sandbox=False, args=FLAGS
        )
        test = ["--camera", CAMERA, "--load", "sim:", "--section", "20,2", "--meta", "specimen=bar-6"]
        program = Program(Path(work), "page", *test, "--no-view", "--no-rrd", "--page-port", "0")
        try:
            scheme: Any = "dark" if dark else "light"
            viewport: Any = {"width": size[0], "height": size[1]}
            context = browser.new_context(viewport=viewport, locale="en-US", color_scheme=scheme)
            take_pictures(Page(context.new_page()), program, folder)
            report(Path(work))
            display(browser, Path(work) / "demo" / "view.rrd", folder)
        finally:
            program.kill()
            browser.close()
    return 0


def display(browser: Any, recording: Path, folder: Path) -> None:
    """The display of a recorded test, in rerun's viewer."""
    command = [rerun_command(), "--serve-web", str(recording), "--web-viewer-port", "0", "--port", "9778"]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, start_new_session=True
    ) as viewer:
        assert viewer.stdout is not None
        found = (re.search(r"connect at (http://127\S+)", line) for line in viewer.stdout)
        address = next(one[1] for one in found if one)
        context = browser.new_context(viewport={"width": 1600, "height": 900}, color_scheme="dark")
        page = context.new_page()
        page.goto(f"{address}&renderer=webgl")
        page.wait_for_timeout(20_000)
        page.mouse.click(28, 886)  # pause
        page.mouse.move(265, 886)
        page.mouse.down()
        page.mouse.move(265 + AT * (1392 - 265), 886, steps=8)  # along the line of the time
        page.mouse.up()
        page.wait_for_timeout(5_000)
        picture(Page(page), folder / "demo.png", 1280)
        os.killpg(viewer.pid, signal.SIGTERM)  # its command starts a process of its own


def take_pictures(page: Page, program: Program, folder: Path) -> None:
    """All stages of a test, from set-up to the results."""
    page.page.goto(program.address)
    page.until(lambda: "specimen" in page.text("region"), "the specimen is found")
    page.press("g")
    page.until(lambda: page.page.locator("#gauges li").count() == 3, "gauges are placed")
    page.press("c")
    page.until(lambda: page.text("verdict") in ("GO", "NO-GO"), "it is checked")
    page.page.wait_for_timeout(500)
    picture(page, folder / "page_setup.png")
    page.press("s")
    if page.text("verdict") == "NO-GO":
        page.confirm()
    page.until(lambda: page.page.get_attribute("#state", "data-word") == "measuring", "it measures")
    page.page.wait_for_timeout(26_000)
    picture(page, folder / "page_run.png")
    page.until(lambda: page.stage() == "after", "it is over")
    page.until(lambda: page.page.get_attribute("#report", "aria-disabled") == "false", "the report is made")
    picture(page, folder / "page_after.png")


def picture(page: Page, path: Path, wide: int = WIDE) -> None:
    """A PNG of the page, so many px wide."""
    page.page.screenshot(path=path)
    with Image.open(path) as seen:
        height = round(seen.height * wide / seen.width)
        small = seen.convert("RGB").resize((wide, height), Image.Resampling.LANCZOS)
    small.quantize(COLOURS, dither=Image.Dither.NONE).save(path, optimize=True)


if __name__ == "__main__":
    sys.exit(main(IMAGES))
