"""The pictures that a folder, a glob or the name of a file stands for."""

from __future__ import annotations

import glob
from pathlib import Path

from acquire.addresses import expanded
from acquire.errors import DataError
from acquire.files.picture import FOREIGN
from acquire.text import Message

SUFFIXES = (".tif", ".tiff", ".png", ".bmp", ".jpg", ".jpeg", ".pgm")
_SYSTEM = ("thumbs.db", "ehthumbs.db", "desktop.ini")


def listed(target: str) -> list[Path]:
    """The images of ``find_images`` in no order; raises DataError where there is none."""
    path = expanded(target)
    if path.is_dir():
        there = [item for item in path.iterdir() if _is_seen(item)]
        found = [item for item in there if item.suffix.lower() in SUFFIXES]
    elif path.exists():
        there = found = [path]
    else:
        names = glob.glob(str(path), recursive=True)  # noqa: PTH207 (absolute patterns too)
        there = found = [item for item in map(Path, names) if not item.is_dir() and _is_seen(item)]
    for item in found or there:
        if what := FOREIGN.get(item.suffix.lower()):
            raise DataError("{value}: {what}", item, what)
    if found:
        return found
    if not path.is_dir():
        raise DataError(
            "files:{target}: no image there; looked in {absolute}", target, path.parent.absolute()
        )
    others = ", ".join(sorted(item.name for item in there)[:3])
    only = (
        Message("only {others}{value}", others, " ..." * (len(there) > 3))
        if there
        else Message("it is empty")
    )
    raise DataError(
        "{path}: no picture in this folder ({only}); wanted: {listed}", path, only, ", ".join(SUFFIXES)
    )


def _is_seen(path: Path) -> bool:
    """Whether it is no file of a file manager or hidden."""
    return not path.name.startswith(".") and path.name.lower() not in _SYSTEM
