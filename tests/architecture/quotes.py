"""Messages of the program that its documents quote, and where they stand in the sources."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterable, Iterator
from pathlib import Path

GAP = "\0"  # what an f-string fills in


def quoted(page: Path) -> Iterator[tuple[int, str]]:
    """Line number and words of each line that begins with ``>``."""
    for number, line in enumerate(page.read_text(encoding="utf-8").splitlines(), 1):
        if line.startswith("> "):
            yield number, line[2:].strip()


def strings(modules: Iterable[Path]) -> list[str]:
    """All strings of the sources but docstrings, joined where they are written in parts."""
    found = []
    for path in modules:
        tree = ast.parse(path.read_text(encoding="utf-8"))
        silent = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
        for node in ast.walk(tree):
            if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in silent:
                found.append(node.value)
            elif isinstance(node, ast.JoinedStr):
                found.append("".join(_part(value) for value in node.values))
    return found


def _part(value: ast.expr) -> str:
    return value.value if isinstance(value, ast.Constant) and isinstance(value.value, str) else GAP


def missing(page: Path, words: list[str]) -> Iterator[str]:
    """Quotes that no string of the sources contains; ``…`` stands for anything."""
    for number, quote in quoted(page):
        pattern = re.compile(".*".join(re.escape(part) for part in quote.split("…")), re.DOTALL)
        if not any(pattern.search(text) for text in words):
            yield f"{page.name}:{number}: the program has no message: {quote}"
