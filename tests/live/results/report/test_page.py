"""The page: whole, escaped, by itself, and small; its files; refusals."""

from __future__ import annotations

import csv
import hashlib
import re
from html.parser import HTMLParser
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from acquire.frame import CameraInfo
from analysis.evaluate import NoiseFloor
from live.cli import main
from live.commands import report as command
from live.results.report.page import Html, safe
from live.results.report.record import PracticeValues, reporting_table
from live.results.report.report import ReportRequest, make_report
from live.results.report.saving import find_browser
from live.results.report.svg import MAX_POINTS, Plot, PlotLine, draw
from live.results.run_folder import open_run
from live.ui.terminal.screen import TerminalScreen
from tests.live.made_run import CONFIG, PULLED, make_run

VOID = {"meta", "img", "br", "line", "path", "rect", "circle", "polygon"}


class Reader(HTMLParser):
    """Takes a page apart, and insists that what opens closes."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.seen: dict[str, int] = {}
        self.links: list[str] = []
        self.words: list[str] = []
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.seen[tag] = self.seen.get(tag, 0) + 1
        self.links += [
            value or "" for key, value in attrs if key in ("src", "href", "srcset", "action", "data")
        ]
        assert not [key for key, _ in attrs if key.startswith("on")], "a script in an attribute"
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_starttag(tag, attrs)
        if tag not in VOID:
            self.handle_endtag(tag)

    def handle_endtag(self, tag: str) -> None:
        if tag not in VOID:
            assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.words.append(data)


@pytest.fixture(scope="module")
def text(run_dir: Path) -> str:
    with open_run(run_dir) as run:
        return make_report(run, ReportRequest(("eyy", "exx"), (), 0.05), TerminalScreen(quiet=True)).html


def test_it_stands_alone(text: str) -> None:
    page = Reader(text)
    assert len(text.encode()) < 5_000_000
    assert all(link.startswith("data:image/jpeg;base64,") for link in page.links)
    assert "script" not in page.seen
    assert "link" not in page.seen
    assert set(re.findall(r"https?://[^\s\"'<)]+", text)) == {"http://www.w3.org/2000/svg"}
    assert "url(" not in text.replace("url(#", "")
    assert "default-src 'none'" in text.replace("&#x27;", "'")


def test_what_comes_from_files_is_escaped(text: str) -> None:
    printed = " ".join(Reader(text).words)
    assert "<script>alert('5 > 3 & so on')</script>" in printed
    assert "S1 <b>& so on</b>" in printed
    assert "<script" not in text
    assert "<b>& so" not in text


def test_it_holds_what_a_report_must(text: str, run_dir: Path) -> None:
    page = Reader(text)
    printed = " ".join(page.words)
    for words in (
        "Rp0.2 = 210.2 MPa",  # drawn on the curve
        "first: t =", "elastic: t =", "yield (0.2 %)", "highest force", "last: t =",
        "Figures of the test", "Budget of E", "not stated: specimen.force_error_percent",
        "iso6892: strains", "no break was seen", "lag corrected in the force",
        "Noise floor", "POOR_MATCH", "grabbed", str(8 * len(PULLED)), "reference: 8 frames",
        "not recorded (phasedic run --meta aperture=...)", "50 mm", "6.4 x 4.8 mm", "0.05 mm/px",
        "half of the engineering shear", "numpy",
    ):  # fmt: skip
        assert words in printed, words
    assert "not recorded (phasedic run --meta lens" not in printed
    for name in ("session.h5", "strain.h5", "strain.csv"):
        assert hashlib.sha256((run_dir / name).read_bytes()).hexdigest() in printed
    # Each instant has its picture and its map, of two fields; the statuses have one.
    assert page.seen["img"] == 2 * 2 * 5 + 1 - 2 * 2 * ("highest force, last" in printed)


def test_a_run_without_force_recording_and_section(tmp_path: Path) -> None:
    config = {"measure": {}, "camera": {"address": "files:gone/*.tif"}}
    make_run(tmp_path, [1e-3, 2e-3], session=False, config=config, metadata={})
    with open_run(tmp_path) as run:
        run.strain.values["force_N"][:] = np.nan
        printed = " ".join(Reader(make_report(run, ReportRequest(), TerminalScreen(quiet=True)).html).words)
    assert "there is no stress-strain curve" in printed
    assert "No still phase was found" in printed
    assert "No frame counts were recorded" in printed
    assert "not known: forces, no stresses" in printed


def test_a_large_page_takes_smaller_pictures(run_dir: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with open_run(run_dir) as run:
        full = make_report(run, ReportRequest(), TerminalScreen(quiet=True)).html
        monkeypatch.setattr("live.results.report.report.MAX_BYTES", len(full) - 10)
        assert len(make_report(run, ReportRequest(), TerminalScreen(quiet=True)).html) < len(full) - 10


def test_files(run_dir: Path, tmp_path: Path) -> None:
    out, figures = tmp_path / "r.html", tmp_path / "figures"
    assert main(["report", str(run_dir), "--out", str(out), "--figures", str(figures)]) == 0
    names = {path.name for path in figures.glob("*.svg")}
    assert names == {"stress-strain.svg", "force-time.svg", "strain-time.svg", "valid-time.svg"}
    for svg in figures.glob("*.svg"):
        assert ElementTree.parse(svg).getroot().tag.endswith("svg")
    lines = (figures / "strain-time.csv").read_text(encoding="utf-8").splitlines()
    rows = [row for row in csv.DictReader(lines[1:]) if row["curve"] == "eyy"]
    with open_run(run_dir) as run:
        np.testing.assert_allclose([float(r["y"]) for r in rows], 1e6 * run.strain.values["eyy"], rtol=1e-6)
        np.testing.assert_allclose(
            [float(r["sigma"]) for r in rows], 1e6 * run.strain.values["sigma_eyy"], rtol=1e-3
        )


def test_a_run_that_has_just_ended_gets_its_page(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    make_run(tmp_path / "full")
    make_run(tmp_path / "empty", [], session=False)
    for name in ("full", "empty", "full"):
        command.write_report(tmp_path / name, TerminalScreen())
    printed = capsys.readouterr().out
    assert Reader((tmp_path / "full" / "report.html").read_text(encoding="utf-8")).seen["svg"] > 3
    assert "warning: no report was made: " in printed
    assert "holds no measurement" in printed
    assert "report.html exists already" in printed, "nothing is overwritten"


@pytest.mark.slow
@pytest.mark.skipif(find_browser() is None, reason="no browser here")
def test_pdf_and_png(run_dir: Path, tmp_path: Path) -> None:
    out, figures = tmp_path / "r.html", tmp_path / "figures"
    assert main(["report", str(run_dir), "--out", str(out), "--pdf", "--figures", str(figures)]) == 0
    assert (tmp_path / "r.pdf").read_bytes().startswith(b"%PDF-")
    assert len(list(figures.glob("*.png"))) == 4


def test_without_a_browser_it_says_so(
    run_dir: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(command, "find_browser", lambda: None)
    assert main(["report", str(run_dir), "--out", str(tmp_path / "r.html"), "--pdf"]) == 2
    assert "no browser was found" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_comparison(run_dir: Path, tmp_path: Path) -> None:
    stiffer = make_run(tmp_path / "b", [0.9 * e for e in PULLED])
    out = tmp_path / "c.html"
    assert main(["report", "--compare", str(run_dir), str(stiffer), "--out", str(out)]) == 0
    page = Reader(out.read_text(encoding="utf-8"))
    assert "Comparison of 2 tests" in page.words
    with out.with_suffix(".csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [row["test"] for row in rows] == [
        "S1 <b>& so on</b>", "S1", "mean", "standard deviation", "n",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("code", "message", "arguments"),
    [
        (2, "give the folder of a run", []),
        (4, "no strain.h5 there", ["{tmp}"]),
        (4, "no map 'ezz'", ["{run}", "--field", "ezz"]),
        (2, "mm/px is not possible", ["{run}", "--scale", "0"]),
        (2, "at least two runs", ["--compare", "{run}"]),
        (2, "no section is known", ["--compare", "{run}", "{forces}"]),
        (4, "holds no measurement", ["{empty}"]),
    ],
)
def test_refusals(
    run_dir: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    code: int,
    message: str,
    arguments: list[str],
) -> None:
    made = {"run": run_dir, "tmp": tmp_path, "forces": tmp_path / "forces", "empty": tmp_path / "empty"}
    make_run(made["forces"], [0.0, 1e-3], session=False, config={**CONFIG, "specimen": {"axis": "y"}})
    make_run(made["empty"], [], session=False)
    filled = [word.format(**made) for word in arguments]
    assert main(["report", *filled, "--out", str(tmp_path / "r.html")]) == code
    assert message in capsys.readouterr().err
    assert not (tmp_path / "r.html").exists()


def test_a_second_report_gets_a_number(tmp_path: Path) -> None:
    """Whoever has a page and asks for more of it needs no new name for it."""
    make_run(tmp_path / "run")
    (tmp_path / "run" / "report.html").write_text("precious")
    for _ in range(2):
        assert main(["report", str(tmp_path / "run")]) == 0
    names = sorted(file.name for file in (tmp_path / "run").glob("report*"))
    assert names == ["report-2.html", "report-3.html", "report.html"]
    assert (tmp_path / "run" / "report.html").read_text() == "precious"


def test_nothing_is_overwritten(run_dir: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "r.html"
    out.with_suffix(".csv").write_text("precious")
    assert main(["report", "--compare", str(run_dir), str(run_dir), "--out", str(out)]) == 2
    assert "r.csv exists already" in capsys.readouterr().err
    assert out.with_suffix(".csv").read_text() == "precious"
    assert not out.exists()


def test_thinning_keeps_the_spikes_and_the_gaps() -> None:
    y = np.zeros(50_000)
    y[31_234], y[40_000:40_010] = 7.0, np.nan
    figure = Plot("f", "t", "x", "y", (PlotLine("", np.arange(50_000.0), y),), y_range=(0.0, 7.0))
    svg = draw(figure)
    path = re.search(r'class="curve c1 d1" d="([^"]+)"', svg)
    assert path is not None
    heights = [float(v) for v in re.findall(r"[ML][\d.]+ ([\d.]+)", path[1])]
    assert min(heights) == pytest.approx(44.0 + 224 / 8)  # the top of the axes
    assert path[1].count("M") == 2
    assert len(heights) < 2 * MAX_POINTS


def test_a_logarithmic_axis_keeps_its_first_decades() -> None:
    cycles = np.arange(1.0, 200_001.0)
    svg = draw(Plot("a", "a", "x", "y", (PlotLine("", np.log10(cycles), np.cos(cycles)),)))
    path = re.search(r'class="curve c1 d1" d="([^"]+)"', svg)
    assert path is not None
    across = np.array([float(v) for v in re.findall(r"[ML]([\d.]+) ", path[1])])
    assert len(across) < 2 * MAX_POINTS
    decade = np.ptp(across) / np.log10(cycles[-1])
    assert np.count_nonzero(across < across[0] + 1.01 * decade) >= 10, "all of the first ten"
    assert np.count_nonzero(across < across[0] + 2.01 * decade) >= 90


def test_words_are_escaped_once() -> None:
    assert safe("<&") == "&lt;&amp;"
    assert safe(safe("<")) == "&lt;"
    assert isinstance(safe("<"), Html)


def test_the_reporting_table_has_the_camera_in_the_units_it_names(run_dir: Path) -> None:
    camera = CameraInfo("v4l2:", "a camera", 1280, 960, 12, True, "device", fps=25.0, exposure_s=0.008)
    with open_run(run_dir) as run:
        floors = {"u": NoiseFloor(0.004, 0.005), "exx": NoiseFloor(40e-6, 50e-6)}
        text = re.sub("<[^>]*>", "|", reporting_table(PracticeValues(run, camera, None, floors, 0.05)))
    for shown in ("1280 x 960 px, 12 bits", "64 x 48 mm", "0.05 mm/px", "25 frames/s", "8 ms"):
        assert f"|{shown}|" in text, shown
    assert "|u 0.004 px (1 standard deviation" in text and "|exx 40 µm/m (1 standard deviation" in text


@pytest.mark.parametrize(
    ("language", "belief", "head"),
    [
        ("en", "E, nu, Rp0.2 can be believed.", "Figures of the test"),
        ("de", "E, nu, Rp0.2 sind glaubhaft.", "Werte des Versuchs"),
        ("fr", "E, nu, Rp0.2 sont fiables.", "Valeurs de l’essai"),
    ],
)
def test_the_report_is_in_the_language_of_the_terminal(
    language: str, belief: str, head: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The sentence of belief is its first band, as on the page; the decimal mark is that of the language."""
    monkeypatch.setenv("LC_ALL", f"{language}_XX.UTF-8")
    with open_run(make_run(tmp_path / "run", PULLED)) as run:
        warned = make_report(run, ReportRequest(), TerminalScreen(quiet=True)).html
        run.__dict__["events"] = [one for one in run.events if one.level == "info"]
        text = make_report(run, ReportRequest(), TerminalScreen(quiet=True)).html
    assert '<p class="band look">' in warned, "a warning stands against the figures, as on the page"
    bands = re.findall(r'<p class="band (\w+)">(.*?)</p>', text)
    assert bands[0][0] == "good" and bands[0][1].startswith(belief), bands
    assert f"<h2>{head}</h2>" in text and f'<html lang="{language}">' in text
    modulus = re.search(r'<h3>E</h3><p class="value"><b>(.*?)</b> GPa', text)
    assert modulus and ("," in modulus[1]) == (language != "en"), modulus
