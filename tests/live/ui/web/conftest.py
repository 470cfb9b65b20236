"""A browser for the tests of the page, and ``phasedic page`` with a page on it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from live.setup.compiling import compile_ahead
from tests.live.ui.web.browser import FLAGS, Page, Program, chromium

CAMERA = "sim:uniform?width=256&height=192&fps=15&hold=4&end=1&buffers=64&seconds={seconds}"
OPTIONS = ["--zoi", "32", "--section", "20,2", "--scale", "0.1", "--no-view", "--no-rrd", "--page-port", "0"]
Begin, Start = Callable[..., Program], Callable[..., Page]


@pytest.fixture(scope="session")
def browser() -> Iterator[Any]:
    """One browser; every page has a context of its own."""
    path = chromium()
    compile_ahead(("uint16", "float32"))  # here, so that the time limits of the tests need not cover it
    from playwright.sync_api import sync_playwright

    with sync_playwright() as driver:
        opened = driver.chromium.launch(
            executable_path=path, headless=True, chromium_sandbox=False, args=FLAGS
        )
        yield opened
        opened.close()


@pytest.fixture(autouse=True)
def no_page_stays_open(request: pytest.FixtureRequest) -> Iterator[None]:
    """Pages that a test opened go with it: each one that stays draws on and asks its program."""
    if "browser" not in request.fixturenames:
        yield
        return
    opened = request.getfixturevalue("browser")
    before = opened.contexts
    yield
    for context in opened.contexts:
        if context not in before:
            context.close()


@pytest.fixture
def begin(tmp_path: Path) -> Iterator[Begin]:
    """Starts ``phasedic`` in a folder of its own; whatever happens, it does not run on."""
    programs: list[Program] = []

    def started(*words: str) -> Program:
        programs.append(Program(tmp_path, *words))
        return programs[-1]

    yield started
    for program in programs:
        program.kill()
    assert not programs or "Traceback" not in (tmp_path / "err.txt").read_text()


@pytest.fixture
def start(browser: Any, begin: Begin) -> Start:
    """Starts ``phasedic page`` and opens it."""

    def started(
        seconds: int = 300, load: str = "sim:", locale: str = "en-US", camera: str = CAMERA, **wanted: Any
    ) -> Page:
        program = begin("page", "--camera", camera.format(seconds=seconds), "--load", load, *OPTIONS)
        return another(browser, program.address, locale, **wanted)

    return started


def opened(browser: Any, address: str, locale: str = "en-US", **wanted: Any) -> Page:
    """A page at the address, in a context of its own."""
    viewport = {"width": 1280, "height": 800}
    page = Page(browser.new_context(viewport=viewport, locale=locale, **wanted).new_page())
    page.address = address
    page.goto(address)
    return page


def another(browser: Any, address: str, locale: str = "en-US", **wanted: Any) -> Page:
    """The same, as soon as it shows the specimen."""
    page = opened(browser, address, locale, **wanted)
    page.until(lambda: bool(page.text("region")), "the specimen is found")
    return page


def measuring(page: Page) -> None:
    """Wait until the test measures."""
    page.until(lambda: page.page.get_attribute("#state", "data-word") == "measuring", "it measures")


def started(page: Page) -> None:
    """From the set-up, without a check, into the measuring test."""
    page.press("s")
    page.confirm()
    measuring(page)
