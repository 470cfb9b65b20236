"""Makes the pages of documentation: ``make docs``, or ``python -m docs.make_site`` with the extra ``docs``.

README, docs and examples are laid side by side as they lie here, so that every link between them holds; mkdocs
(mkdocs.yml) makes ``build/site`` of them, and mkdocstrings the reference from the docstrings. A link that leads nowhere
ends it with an error.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
PAGES = ROOT / "build" / "pages"
REFERENCE = {
    "Tests and replays from a program": "live.commands.from_python",
    "Kernel, grid and field": "analysis",
    "Gauges and figures of a test": "analysis.evaluate",
    "Results": "live.results",
    "A finished run": "live.results.run_folder",
    "Export": "live.results.export",
    "Report": "live.results.report",
    "Replay": "live.replay",
    "A consumer of your own": "live.pipeline.consumer",
    "Cameras": "acquire.camera",
    "Load cells": "acquire.load_cell",
    "Recorded sessions": "acquire.session",
}
"""Heading -> module whose public names are described."""

HIDDEN = ("__pycache__", "*.pyc", "make_*.py", "layers.py", "__init__.py")


def lay_out() -> None:
    """All sources of pages in one folder, the README as its first page."""
    shutil.rmtree(PAGES, ignore_errors=True)
    PAGES.mkdir(parents=True)
    shutil.copy(ROOT / "README.md", PAGES / "index.md")
    for name in ("CHANGELOG.md", "CONTRIBUTING.md", "CITATION.cff", "LICENSE"):
        shutil.copy(ROOT / name, PAGES / name)
    for folder in ("docs", "examples"):
        shutil.copytree(ROOT / folder, PAGES / folder, ignore=shutil.ignore_patterns(*HIDDEN))
    (PAGES / "reference.md").write_text(reference(), encoding="utf-8")


def reference() -> str:
    """The page that mkdocstrings fills from the docstrings."""
    parts = [f"## {words}\n\n::: {module}\n" for words, module in REFERENCE.items()]
    head = "# Reference\n\nFrom the docstrings. Public is what `from phasedic import ...` has; the rest may change.\n"
    return "\n".join([head, *parts])


def main() -> int:
    """Lay out and build; mkdocs' own exit code."""
    lay_out()
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "-f", str(ROOT / "mkdocs.yml")]
    code = subprocess.run(command, cwd=ROOT, check=False).returncode
    if code == 0:
        print(ROOT / "build" / "site" / "index.html")
    return code


if __name__ == "__main__":
    sys.exit(main())
