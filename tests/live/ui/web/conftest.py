"""One browser for all tests of the page."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from live.setup.compiling import compile_ahead
from tests.live.ui.web.browser import FLAGS, chromium


@pytest.fixture(scope="session")
def browser() -> Iterator[Any]:
    path = chromium()
    compile_ahead(("uint16", "float32"))  # here, so that the time limits of the tests need not cover it
    from playwright.sync_api import sync_playwright

    with sync_playwright() as driver:
        opened = driver.chromium.launch(
            executable_path=path, headless=True, chromium_sandbox=False, args=FLAGS
        )
        yield opened
        opened.close()
