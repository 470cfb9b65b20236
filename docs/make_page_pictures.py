"""The pictures of the operator's page: ``python -m docs.make_page_pictures`` (chromium, playwright, pillow).

A simulated test, set up and run by mouse and keyboard in a headless browser.
"""

from __future__ import annotations

import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from PIL import Image
from playwright.sync_api import sync_playwright

from tests.live.ui.web.browser import FLAGS, Page, Program, chromium

IMAGES = Path(__file__).parent / "images"
CAMERA = "sim:woven?fps=15&seconds=44&hold=8&buffers=64&px_per_mm=20"
COLOURS = 256
WIDE = 960  # px in the documents


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
        finally:
            program.kill()
            browser.close()
    return 0


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


def picture(page: Page, path: Path) -> None:
    """A small PNG of the page."""
    page.page.screenshot(path=path)
    with Image.open(path) as seen:
        height = round(seen.height * WIDE / seen.width)
        small = seen.convert("RGB").resize((WIDE, height), Image.Resampling.LANCZOS)
    small.quantize(COLOURS, dither=Image.Dither.NONE).save(path, optimize=True)


if __name__ == "__main__":
    sys.exit(main(IMAGES))
