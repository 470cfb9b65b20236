"""The files of a report: the page, its PDF, and each figure as SVG, PNG and CSV.

A headless browser makes PDF and PNG, where one is installed.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from acquire.errors import ConfigError, DataError
from acquire.text import Message
from live.config.new_files import new_file, new_folder
from live.pipeline.consumer import Screen
from live.results.report.report import Report
from live.results.report.svg import HEIGHT, WIDTH, Plot, draw

_NAMES = (
    *("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome", "msedge"),
    "/Applications/Google Chrome.app/Contents/MacOS/Google Chrome",
)
_INSTALL = "`apt install chromium` on Debian"
NO_BROWSER = Message(
    "no browser was found (chromium, Chrome or Edge); print the page from yours, or install one: {command}",
    _INSTALL,
)
NO_PNG = Message(
    "no browser was found, so the figures are SVG and CSV without PNG ({command} installs one)", _INSTALL
)
_TIMEOUT_S = 120


def find_browser() -> str | None:
    """The path of a browser, or None."""
    return next((path for path in map(shutil.which, _NAMES) if path), None)


def to_pdf(page: Path, pdf: Path) -> None:
    """Print a page; raises as ``_run``."""
    _run(page, pdf, ["--no-pdf-header-footer", f"--print-to-pdf={pdf.resolve()}"])


def to_png(picture: Path, png: Path, width: int, height: int) -> None:
    """Render a page or SVG in a window of this size, px; raises as ``_run``."""
    _run(
        picture,
        png,
        ["--hide-scrollbars", f"--screenshot={png.resolve()}", f"--window-size={width},{height}"],
    )


def _run(page: Path, target: Path, arguments: list[str]) -> None:
    """Make ``target`` from ``page`` with the browser.

    Raises
    ------
    ConfigError
        There is no browser.
    DataError
        It failed, or took too long.
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
                timeout=_TIMEOUT_S,
                check=False,
            )
        except subprocess.TimeoutExpired:
            raise DataError(
                "{browser} did not finish {file} within {limit} s", browser, target.name, _TIMEOUT_S
            ) from None
    if not target.exists() or not target.stat().st_size:
        words = done.stderr.decode(errors="replace").strip().splitlines()[-1:]
        raise DataError("{browser} failed on {page} ({why})", browser, page.name, " ".join(words))


def save_page(report: Report, path: Path) -> None:
    """The HTML file; raises as ``new_file``."""
    with new_file(path) as part:
        part.write_text(report.html, encoding="utf-8")


def save_pdf(page: Path, path: Path) -> None:
    """The page printed by a headless browser; raises ConfigError where there is none."""
    with new_file(path) as part:
        try:
            to_pdf(page, part)
        except DataError as error:
            raise DataError(
                "{path}: {why}; open {page} in a browser and print it", path, error, page
            ) from error


def save_figures(figures: Sequence[Plot], folder: Path, screen: Screen) -> None:
    """Each as SVG and CSV, and as PNG where a browser works; raises as ``new_folder``."""
    with new_folder(folder) as part:
        for figure in figures:
            svg = part / f"{figure.name}.svg"
            svg.write_text(draw(figure, standalone=True), encoding="utf-8")
            (part / f"{figure.name}.csv").write_text(as_csv(figure), encoding="utf-8")
        if trouble := _png_trouble([part / f"{figure.name}.svg" for figure in figures]):
            screen.print(Message("warning: {what}", trouble))


def _png_trouble(pictures: Sequence[Path]) -> str:
    """Render each SVG beside it; why that is not possible, at the first that fails."""
    if find_browser() is None:
        return NO_PNG
    try:
        for svg in pictures:
            to_png(svg, svg.with_suffix(".png"), WIDTH, HEIGHT)
    except (DataError, OSError) as error:
        return Message("the figures are SVG and CSV without PNG: {error}", error)
    return ""


def as_csv(figure: Plot) -> str:
    """The points of all curves, one a line: curve, x, y, and half the width of the band."""
    lines = [f"# {figure.title}; x: {figure.x_label}; y: {figure.y_label}", "curve,x,y,sigma"]
    for curve in figure.curves:
        sigma = curve.sigma if curve.sigma is not None else np.full(len(curve.x), np.nan)
        name = curve.label.replace('"', "'")
        lines += [
            f'"{name}",{x:.9g},{y:.9g},{s:.4g}' for x, y, s in zip(curve.x, curve.y, sigma, strict=True)
        ]
    return "\n".join(lines) + "\n"
