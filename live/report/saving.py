"""The files of a report: the page, its PDF, and each figure as SVG, PNG and the CSV behind it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from live.export import new_file, new_folder
from live.measure import Screen
from live.report.browser import NO_PNG, find_browser, to_pdf, to_png
from live.report.report import Report
from live.report.svg import HEIGHT, WIDTH, Figure, draw


def save_page(report: Report, path: Path) -> None:
    """The HTML file; raises as ``new_file``."""
    with new_file(path) as part:
        part.write_text(report.html, encoding="utf-8")


def save_pdf(page: Path, path: Path) -> None:
    """The page printed by a browser without a window; raises ConfigError where there is none."""
    with new_file(path) as part:
        to_pdf(page, part)


def save_figures(figures: Sequence[Figure], folder: Path, screen: Screen) -> None:
    """Each as SVG and CSV, and as PNG where there is a browser to make it; raises as ``new_folder``."""
    browser = find_browser()
    with new_folder(folder) as part:
        for figure in figures:
            svg = part / f"{figure.name}.svg"
            svg.write_text(draw(figure, alone=True), encoding="utf-8")
            (part / f"{figure.name}.csv").write_text(as_csv(figure), encoding="utf-8")
            if browser is not None:
                to_png(svg, svg.with_suffix(".png"), WIDTH, HEIGHT)
    if browser is None:
        screen.say(NO_PNG)


def as_csv(figure: Figure) -> str:
    """The points of all curves, a line each: curve, x, y, and half the width of the band."""
    lines = [f"# {figure.title}; x: {figure.x_label}; y: {figure.y_label}", "curve,x,y,sigma"]
    for curve in figure.curves:
        sigma = curve.sigma if curve.sigma is not None else np.full(len(curve.x), np.nan)
        name = curve.label.replace('"', "'")
        lines += [
            f'"{name}",{x:.9g},{y:.9g},{s:.4g}' for x, y, s in zip(curve.x, curve.y, sigma, strict=True)
        ]
    return "\n".join(lines) + "\n"
