"""``phasedic examples`` and ``phasedic docs``: what is copied measures as its README says, and every page is shown."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from live.cli import main as phasedic
from live.commands.examples import E_PA, NU, STRESSES_PA, STRIP_STRAINS, strain_at
from live.results.run_folder import open_run

ROOT = Path(__file__).parents[3]


@pytest.fixture(scope="module")
def copied(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("first") / "hour"
    assert phasedic(["examples", str(folder)]) == 0
    return folder


def test_the_examples_come_with_pictures_and_a_notebook(copied: Path) -> None:
    assert len(list((copied / "shots").glob("*.png"))) == len(STRESSES_PA) == 20
    assert len(list((copied / "strip").glob("*.jpg"))) == len(STRIP_STRAINS)
    assert (copied / "README.md").read_text() == (ROOT / "examples" / "README.md").read_text()
    assert not list(copied.rglob("__*"))
    cells = json.loads((copied / "notebook.ipynb").read_text())["cells"]
    code = [cell["source"] for cell in cells if cell["cell_type"] == "code"]
    assert cells[0]["source"].startswith("Phasedic from Python")
    assert len(code) > 4
    for cell in code:
        compile(cell, "cell", "exec")


def test_nothing_is_overwritten(copied: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert phasedic(["examples", str(copied)]) == 2
    assert "is not overwritten" in capsys.readouterr().err


def test_the_pictures_of_the_tensile_test_give_what_the_readme_says(
    copied: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(copied)
    (row,) = re.findall(r"\| `phasedic (replay shots [^`]*)` \| (.*) \|", Path("README.md").read_text())
    assert phasedic([*row[0].split(), "--no-view", "--no-rrd", "--out", "out"]) == 0
    printed = capsys.readouterr().out
    for figure in ("E", "nu", "Rp0.2"):
        (quoted,) = re.findall(rf"{re.escape(figure)} = [\d.]+", row[1])
        assert quoted in printed
    with open_run("out") as run:
        last = run.axial_strain[-1]
    assert last == pytest.approx(strain_at(STRESSES_PA[-1]), rel=0.002)
    (found,) = re.findall(r"E = ([\d.]+) ± ([\d.]+)", printed)
    assert abs(float(found[0]) - E_PA / 1e9) < float(found[1])
    (found,) = re.findall(r"nu = ([\d.]+) ± ([\d.]+)", printed)
    assert abs(float(found[0]) - NU) < float(found[1])
    assert Path("out/report.html").exists()


def test_each_page_is_shown_under_the_names_of_messages(capsys: pytest.CaptureFixture[str]) -> None:
    for name in ("optics", "optics.md", "docs/optics.md"):
        assert phasedic(["docs", name]) == 0
        assert capsys.readouterr().out == (ROOT / "docs" / "optics.md").read_text() + "\n"


def test_a_section_is_shown_up_to_the_next_heading(capsys: pytest.CaptureFixture[str]) -> None:
    assert phasedic(["docs", "docs/load-cells.md#forces-from-a-file"]) == 0
    shown = capsys.readouterr().out
    assert shown.startswith("## Forces from a file\n") and "--load-column" in shown and "## Tare" not in shown
    assert phasedic(["docs", "guide#set-up"]) == 0
    shown = capsys.readouterr().out
    assert "### Scale\n" in shown and not shown.rstrip().endswith("## Check")
    assert phasedic(["docs", "method#13-errata-of-the-printed-paper"]) == 0
    assert capsys.readouterr().out.startswith("## 13. Errata")


def test_pages_are_listed_and_an_unknown_one_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert phasedic(["docs"]) == 0
    assert "troubleshooting            Troubleshooting\n" in capsys.readouterr().out
    assert phasedic(["docs", "optics#lens"]) == 2
    assert "optics has no section lens; phasedic docs optics shows all" in capsys.readouterr().err
    assert phasedic(["docs", "optcs"]) == 2
    assert "did you mean optics?" in capsys.readouterr().err


def test_every_page_that_a_message_names_is_shown_and_stands_on_the_site(
    capsys: pytest.CaptureFixture[str],
) -> None:
    code = (
        path for place in ("acquire", "analysis", "hw_mocks", "live") for path in (ROOT / place).rglob("*.py")
    )
    named = {page for path in code for page in re.findall(r"docs/([\w-]+\.md)", path.read_text("utf-8"))}
    site = (ROOT / "mkdocs.yml").read_text("utf-8").partition("not_in_nav")[0]
    assert len(named) > 8 and "optics.md" in named
    for page in sorted(named):
        assert phasedic(["docs", f"docs/{page}"]) == 0, page
        assert capsys.readouterr().out == (ROOT / "docs" / page).read_text("utf-8") + "\n"
        assert f"docs/{page}\n" in site, page
