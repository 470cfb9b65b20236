"""Plots as SVG, by value, and the files of figures."""

from __future__ import annotations

import re
import subprocess
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from acquire.errors import ConfigError, DataError
from live.results.report import saving
from live.results.report.saving import as_csv, save_figures, save_page, save_pdf, to_pdf, to_png
from live.results.report.svg import Mark, Plot, PlotLine, draw
from tests.live.screens import RecordingScreen


def numbers(text: str) -> list[float]:
    return [float(word) for word in re.findall(r"-?\d+(?:\.\d+)?", text)]


def test_a_line_is_drawn_from_left_to_right_and_upwards() -> None:
    """The axes are 498 px wide and 224 high, from (64, 44) to (562, 268)."""
    line = PlotLine(
        "a", np.array([0.0, 5.0, 10.0]), np.array([0.0, 10.0, 20.0]), np.array([1.0, 2.0, 1.0]), 2
    )
    svg = draw(Plot("f", "t", "x", "y", (line,), (Mark(5.0, 10.0, "a", "1 N"),
                    Mark(9.5, 20.0, "b", "2 N", is_bound=True)), (0.0, 10.0), (0.0, 20.0)))  # fmt: skip
    path = re.search(r'class="curve c3 d3" d="(M64[^"]+)"', svg)
    assert path is not None and numbers(path[1]) == [64, 268, 313, 156, 562, 44]
    band = re.search(r'class="band f3" points="([^"]+)"', svg)
    assert band is not None
    # Forth along the lower edge, back along the upper one.
    assert numbers(band[1]) == pytest.approx(
        [64, 279.2, 313, 178.4, 562, 55.2, 562, 32.8, 313, 133.6, 64, 256.8], abs=0.06
    )
    circles = re.findall(r'<circle class="dot" cx="([\d.]+)" cy="([\d.]+)"', svg)
    assert circles == [("313.0", "156.0"), ("537.1", "44.0")]
    assert '<text class="word ink" x="321.0" y="174.0" text-anchor="start">a = 1 N<' in svg
    assert '<text class="word ink" x="529.1" y="62.0" text-anchor="end">b ≥ 2 N<' in svg
    assert '<text class="word" x="188.5" y="284.0" text-anchor="middle">2.5<' in svg
    assert '<text class="word" x="58.0" y="160.0" text-anchor="end">10<' in svg
    assert '<text class="word ink" x="4.0" y="14.0" text-anchor="start">y<' in svg, "never turned"


@pytest.mark.parametrize(
    ("low", "high", "ends", "marks"),
    [
        (0.0, 1.0, ("0", "1"), 5),
        (0.3, 18.9, ("0", "20"), 5),
        (-7.7, 20.3, ("−10", "30"), 5),
        (-0.002, 283.0, ("0", "300"), 4),
        (3.2, 3.9, ("3.2", "4"), 5),
        (-1400.0, -3.0, ("−1 500", "0"), 4),
    ],
)
def test_axes_end_at_round_numbers(low: float, high: float, ends: tuple[str, str], marks: int) -> None:
    svg = draw(Plot("f", "t", "x", "y", (PlotLine("", np.arange(2.0), np.array([low, high])),)))
    found = re.findall(r'x="58.0" y="([\d.]+)" text-anchor="end">([^<]+)<', svg)
    assert (found[0], found[-1]) == (("272.0", ends[0].replace(" ", "\u202f")), ("48.0", ends[1])), found
    assert len(found) == marks


def test_axes_hold_data_and_bands() -> None:
    def down(y: list[float], sigma: list[float] | None = None, dashed: float = 0.0) -> list[float]:
        band = None if sigma is None else np.array(sigma)
        lines = [PlotLine("", np.arange(float(len(y))), np.array(y), band)]
        if dashed:
            lines.append(PlotLine("", np.array([0.0, 1.0]), np.array([0.0, dashed]), dashed=True))
        found = re.search(r'class="curve c1 d1" d="([^"]+)"', draw(Plot("f", "t", "x", "y", tuple(lines))))
        assert found is not None
        return numbers(found[1])[1::2]

    assert down([0.0, 1.0]) == pytest.approx([268, 44], abs=0.06)
    assert down([0.0, 1.0], dashed=50.0) == down([0.0, 1.0]), "a construction does not widen the axes"
    wide = down([0.0, 1.0], [0.5, 1.0])
    assert wide == pytest.approx([268 - 224 / 3, 268 - 224 * 2 / 3], abs=0.06), "from -1 to 2"
    assert down([4.0, 4.0]) == pytest.approx([156, 156]), "a constant lies in the middle"
    assert down([0.0, 0.0]) == pytest.approx([156, 156])


def test_a_gap_interrupts_the_line() -> None:
    y = np.array([0.0, 1.0, np.nan, 3.0, 4.0])
    svg = draw(Plot("f", "t", "x", "y", (PlotLine("", np.arange(5.0), y),), (), (0, 4), (0, 4)))
    found = re.search(r'class="curve c1 d1" d="([^"]+)"', svg)
    assert found is not None and re.sub(r"[\d. ]", "", found[1]) == "MLML"


def test_the_legend_names_each_line_in_its_colour() -> None:
    lines = tuple(PlotLine(name, np.arange(2.0), np.arange(2.0), colour=k, dashed=k == 1)
                  for k, name in enumerate(("ab", "c<d", "")))  # fmt: skip
    svg = draw(Plot("f", "t", "x", "y", lines))
    assert '<path class="curve c1 d1" d="M64 30h24"/>' in svg and ">ab</text>" in svg
    assert '<path class="curve c2 dashed" d="M121 30h24"/>' in svg and ">c&lt;d</text>" in svg
    assert svg.count(" 30h24") == 2
    assert "c2 d2" in draw(Plot("f", "t", "x", "y", (replace(lines[0], colour=7),)))


def test_only_long_lines_are_thinned() -> None:
    for n, drawn in ((1600, 1600), (1601, None)):
        svg = draw(Plot("f", "t", "x", "y", (PlotLine("", np.arange(n * 1.0), np.arange(n * 1.0)),)))
        found = re.search(r'class="curve c1 d1" d="([^"]+)"', svg)
        assert found is not None
        points = len(re.findall("[ML]", found[1]))
        assert points == drawn if drawn else points <= 1602


PLOT = Plot("f", "a title", "x, s", "y, N", (
    PlotLine('say "a"', np.array([1.0, 2.0]), np.array([3.0, 4.0]), np.array([0.5, 0.25])),
    PlotLine("b", np.array([1.0]), np.array([np.nan])),
))  # fmt: skip


def test_the_points_of_a_figure_as_csv() -> None:
    assert as_csv(PLOT).splitlines() == [
        "# a title; x: x, s; y: y, N", "curve,x,y,sigma", "\"say 'a'\",1,3,0.5", "\"say 'a'\",2,4,0.25",
        '"b",1,nan,nan',
    ]  # fmt: skip


@pytest.fixture
def browser(monkeypatch: pytest.MonkeyPatch) -> list[list[str]]:
    """A browser that writes what it is asked for, or nothing where the page is named so."""
    asked: list[list[str]] = []

    def run(command: list[str], **how: Any) -> Any:
        asked.append(command)
        assert how["timeout"] > 10 and how["check"] is False
        if "slow" in command[-1]:
            raise subprocess.TimeoutExpired(command, 120)
        target = next(word.partition("=")[2] for word in command if word.startswith(("--print", "--screens")))
        if "broken" not in command[-1]:
            Path(target).write_bytes(b"made" if "empty" not in command[-1] else b"")
        return SimpleNamespace(stderr=b"first\nno display\n")

    monkeypatch.setattr(saving, "find_browser", lambda: "/usr/bin/chromium")
    monkeypatch.setattr(saving.subprocess, "run", run)
    return asked


def test_a_browser_makes_pdf_and_png(tmp_path: Path, browser: list[list[str]]) -> None:
    page, pdf, png = (tmp_path / f"a.{end}" for end in ("html", "pdf", "png"))
    to_pdf(page, pdf)
    to_png(page, png, 580, 310)
    first, second = browser
    assert first[0] == "/usr/bin/chromium" and "--headless=new" in first
    assert first[-1] == second[-1] == page.as_uri()
    assert f"--print-to-pdf={pdf}" in first and "--no-pdf-header-footer" in first
    assert f"--screenshot={png}" in second and "--window-size=580,310" in second
    save_pdf(page, tmp_path / "b.pdf")
    assert (tmp_path / "b.pdf").read_bytes() == b"made"


@pytest.mark.parametrize(
    ("name", "words"),
    [("broken", r"failed on broken.html \(no display\)"), ("empty", "failed on empty.html"),
     ("slow", "did not finish .* within 120 s")],
)  # fmt: skip
def test_a_browser_that_fails_is_told(
    tmp_path: Path, browser: list[list[str]], name: str, words: str
) -> None:
    with pytest.raises(DataError, match=words + ".*; open .* in a browser and print it"):
        save_pdf(tmp_path / f"{name}.html", tmp_path / "a.pdf")
    assert not (tmp_path / "a.pdf").exists()


def test_without_a_browser_there_are_svg_and_csv(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(saving, "find_browser", lambda: None)
    screen = RecordingScreen()
    save_figures([PLOT], tmp_path / "figures", screen)
    assert {path.name for path in (tmp_path / "figures").iterdir()} == {"f.svg", "f.csv"}
    assert 'fill="#fff"' in (tmp_path / "figures/f.svg").read_text()
    assert screen.lines == [f"warning: {saving.NO_PNG}"]
    with pytest.raises(ConfigError, match="no browser was found"):
        to_pdf(tmp_path / "a.html", tmp_path / "a.pdf")


def test_with_a_browser_there_are_png_too(tmp_path: Path, browser: list[list[str]]) -> None:
    screen = RecordingScreen()
    save_figures([PLOT, replace(PLOT, name="g")], tmp_path / "figures", screen)
    assert {path.name for path in (tmp_path / "figures").glob("*.png")} == {"f.png", "g.png"}
    assert screen.lines == [] and len(browser) == 2
    save_figures([replace(PLOT, name="broken")], tmp_path / "others", screen)
    assert len(screen.lines) == 1 and "SVG and CSV without PNG: " in screen.lines[0]
    save_page(SimpleNamespace(html="é"), tmp_path / "p.html")  # type: ignore[arg-type]
    assert (tmp_path / "p.html").read_bytes() == "é".encode()
