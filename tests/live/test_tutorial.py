"""The commands of docs/tutorial.md run as they stand, and print the lines that stand below them."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "tutorial.md"
BLOCK = re.compile(r"^```(sh|text)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
MARK = "=== block"


def chapters() -> dict[str, list[tuple[str, str]]]:
    """Heading -> the commands of each block, and what is quoted below it."""
    found = {}
    for part in re.split(r"^## ", PAGE.read_text(encoding="utf-8"), flags=re.MULTILINE)[1:]:
        blocks: list[tuple[str, str]] = []
        for kind, text in BLOCK.findall(part):
            if kind == "sh":
                blocks.append((text, ""))
            else:
                blocks[-1] = blocks[-1][0], text
        found[part.partition("\n")[0]] = blocks
    return found


def run_chapter(blocks: list[tuple[str, str]], folder: Path) -> list[str]:
    """What each block printed; a command that fails ends it."""
    (folder / "bin").mkdir()
    for name, module in (("phasedic", "-m phasedic"), ("python", "")):
        (folder / "bin" / name).write_text(f'#!/bin/sh\nexec {sys.executable} {module} "$@"\n')
        (folder / "bin" / name).chmod(0o755)
    script = "set -e\n" + "".join(f"echo '{MARK}'\n{commands}" for commands, _ in blocks)
    surroundings = {
        **os.environ,
        "PATH": f"{folder / 'bin'}:{os.environ['PATH']}",
        "PYTHONPATH": str(ROOT),
    }
    done = subprocess.run(
        ["bash", "-c", script], cwd=folder, env=surroundings, stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=240, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout
    return done.stdout.replace("\r", "\n").split(MARK)[1:]


def absent(quoted: str, printed: str) -> list[str]:
    """The quoted lines that were not printed, in order; ``…`` stands for anything."""
    lines, missing = iter(printed.splitlines()), []
    for quote in quoted.splitlines():
        pattern = re.compile(".*".join(re.escape(part) for part in quote.split("…")))
        left = list(lines)
        at = next((k for k, line in enumerate(left) if pattern.fullmatch(line.rstrip())), None)
        missing += [quote] if at is None else []
        lines = iter(left if at is None else left[at + 1 :])
    return missing


@pytest.mark.slow
@pytest.mark.parametrize("heading", chapters())
def test_a_chapter_runs_as_written(heading: str, tmp_path: Path) -> None:
    blocks = chapters()[heading]
    printed = run_chapter(blocks, tmp_path)
    assert len(printed) == len(blocks) > 0
    for (commands, quoted), said in zip(blocks, printed, strict=True):
        assert not absent(quoted, said), f"{commands}\nprinted:\n{said}"


def test_a_line_that_was_not_printed_is_found() -> None:
    printed = "one\ntwo: 3 s\n"
    assert absent("one\ntwo: … s\n", printed) == []
    assert absent("two: … s\none\n", printed) == ["one"]
