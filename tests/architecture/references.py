"""References to our modules and files in documentation, docstrings and comments, and whether they exist."""

from __future__ import annotations

import ast
import io
import re
import tokenize
from collections.abc import Iterator
from functools import cache
from pathlib import Path

_DOTTED = re.compile(r"(?<![\w./-])(?:acquire|analysis|hw_mocks|live|tests|docs)(?:\.\w+)+")
_PATH = re.compile(r"(?<![\w./*-])(?:\w+/)*\w+\.py\b")


def dead_references(root: Path, path: Path) -> Iterator[str]:
    """Names and paths in the words of ``path`` (all of a page, docstrings and comments of a module)."""
    place = path.relative_to(root).as_posix()
    for number, line in words(path):
        yield from (
            f"{place}:{number}: {found} is not there any more; name what is" for found in dead_in(root, line)
        )


def dead_in(root: Path, line: str) -> Iterator[str]:
    """What ``line`` names below ``root`` that is not there."""
    yield from (found for found in _DOTTED.findall(line) if not _named(root, found.split(".")))
    yield from (found for found in _PATH.findall(line) if not any(_stands(root, found)))


def words(path: Path) -> Iterator[tuple[int, str]]:
    """The lines of a page; of a module its docstrings and comments."""
    text = path.read_text(encoding="utf-8")
    if path.suffix != ".py":
        yield from enumerate(text.splitlines(), 1)
        return
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.COMMENT:
            yield token.start[0], token.string
    for node in ast.walk(ast.parse(text)):
        if (
            isinstance(node, ast.Expr)
            and isinstance(node.value, ast.Constant)
            and isinstance(node.value.value, str)
        ):
            yield from enumerate(node.value.value.splitlines(), node.lineno)


def _named(root: Path, parts: list[str]) -> bool:
    """Whether the parts lead to a module, and the next one stands in it."""
    place = root
    for number, part in enumerate(parts):
        if (place / part).is_dir():
            place = place / part
            continue
        module = place / f"{part}.py"
        after = parts[number + 1 :] if module.is_file() else parts[number:]
        module = module if module.is_file() else place / "__init__.py"
        text = module.read_text(encoding="utf-8") if module.is_file() else ""
        return not after or re.search(rf"\b{after[0]}\b", text) is not None
    return True


def _stands(root: Path, found: str) -> Iterator[str]:
    """A path from the root, or the end of one."""
    return (path for path in _files(root) if path.endswith(f"/{found}"))


@cache
def _files(root: Path) -> list[str]:
    tops = ("acquire", "analysis", "hw_mocks", "live", "phasedic", "tests", "docs", "examples")
    return [f"/{path.relative_to(root).as_posix()}" for top in tops for path in (root / top).rglob("*.py")]
