"""A browser without a window, where there is one: pages to PDF, figures to PNG."""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from pathlib import Path

from acquire.errors import ConfigError, DataError

_NAMES = (
    *("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome", "msedge"),
    "/Applications/Google Chrome.app/Contents/MacOS/Google Chrome",
)
_INSTALL = "`apt install chromium` on Debian"
NO_BROWSER = (
    f"no browser was found (chromium, Chrome or Edge); print the page from yours, or install one: {_INSTALL}"
)
NO_PNG = f"no browser was found to make PNG of the figures; SVG and CSV are there ({_INSTALL} brings one)"
_TIME_S = 120


def find_browser() -> str | None:
    """Its program, or None."""
    return next((path for path in map(shutil.which, _NAMES) if path), None)


def to_pdf(page: Path, pdf: Path) -> None:
    """Print a page; raises as ``_run``."""
    _run(page, pdf, ["--no-pdf-header-footer", f"--print-to-pdf={pdf.resolve()}"])


def to_png(picture: Path, png: Path, width: int, height: int) -> None:
    """A page or SVG as it looks in a window of this size, px; raises as ``_run``."""
    _run(
        picture,
        png,
        ["--hide-scrollbars", f"--screenshot={png.resolve()}", f"--window-size={width},{height}"],
    )


def _run(page: Path, wanted: Path, arguments: list[str]) -> None:
    """Let the browser make ``wanted`` of ``page``.

    Raises
    ------
    ConfigError
        There is no browser.
    DataError
        It made nothing.
    """
    browser = find_browser()
    if browser is None:
        raise ConfigError(NO_BROWSER)
    with tempfile.TemporaryDirectory() as profile:
        # Its sandbox does not start for root; the page is ours and its policy forbids scripts.
        root = ["--no-sandbox"] if hasattr(os, "geteuid") and os.geteuid() == 0 else []
        plain = [browser, "--headless=new", "--disable-gpu", f"--user-data-dir={profile}", *root]
        try:
            done = subprocess.run(
                [*plain, *arguments, page.resolve().as_uri()],
                capture_output=True,
                timeout=_TIME_S,
                check=False,
            )
        except subprocess.TimeoutExpired:
            raise DataError(
                f"{wanted}: {browser} did not finish within {_TIME_S} s; print the page from it"
            ) from None
    if not wanted.exists():
        words = done.stderr.decode(errors="replace").strip().splitlines()[-1:]
        raise DataError(
            f"{wanted}: {browser} made nothing of {page} ({' '.join(words)}); print the page from it"
        )
