"""Docstrings, comments and documents name modules and files that exist."""

from __future__ import annotations

import importlib
import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
PLACES = ("acquire", "hw_mocks", "examples", "tests/acquire", "tests/contracts", "tests/hw_mocks", "docs")
FILES = [path for place in PLACES for kind in ("*.py", "*.md") for path in sorted((ROOT / place).rglob(kind))]
# A dotted name or a path of a file in backquotes, or a module to run.
NAMED = re.compile(
    r"(?:`|python -m )((?:acquire|hw_mocks|tests[./](?:acquire|hw_mocks|contracts))(?:[./]\w+)+)"
)


def exists(name: str) -> bool:
    """Whether ``name`` is a file, a folder, a module, or an attribute of one."""
    if "/" in name:
        return (ROOT / name).exists()
    parts = name.split(".")
    for k in range(len(parts), 0, -1):
        try:
            found = importlib.import_module(".".join(parts[:k]))
        except ModuleNotFoundError:
            continue
        for part in parts[k:]:
            if not hasattr(found, part):
                return False
            found = getattr(found, part)
        return True
    return False


def test_what_is_named_is_there() -> None:
    gone = [
        f"{path.relative_to(ROOT)}: {name}"
        for path in FILES
        for name in sorted(set(NAMED.findall(path.read_text(encoding="utf-8"))))
        if not exists(name)
    ]
    assert gone == []


def test_the_looking_finds_what_is_gone() -> None:
    gone = ["acquire.gone.Camera", "acquire.camera.gone", "acquire/gone.py"]
    there = ["acquire.camera.open_camera", "acquire/camera", "tests.acquire.session.fuzz"]
    assert NAMED.findall(" ".join(f"`{name}`" for name in gone + there)) == gone + there
    assert [name for name in gone + there if exists(name)] == there
