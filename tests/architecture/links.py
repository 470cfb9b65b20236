"""Links between pages: files that are there, headings that are there."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

_LINK = re.compile(r"!?\[[^\]]*\]\(([^)\s]+)\)")
_CODE = re.compile(r"^(```|~~~).*?^\1", re.MULTILINE | re.DOTALL)
_INLINE = re.compile(r"`[^`\n]*`")
_HEADING = re.compile(r"^#{1,6}\s+(.+?)\s*#*$", re.MULTILINE)
_ELSEWHERE = ("http://", "https://", "mailto:")


def dead_links(root: Path, page: Path) -> Iterator[str]:
    """What ``page`` links to below ``root`` that is not there, nor a heading of what is."""
    text = _INLINE.sub("", _CODE.sub("", page.read_text(encoding="utf-8")))
    for target in _LINK.findall(text):
        if target.startswith(_ELSEWHERE):
            continue
        path, _, anchor = target.partition("#")
        there = (page.parent / path).resolve() if path else page
        if not there.is_relative_to(root) or not there.is_file():
            yield f"{page.relative_to(root)}: links to {target}, which is no file"
        elif anchor and anchor not in headings(there):
            yield f"{page.relative_to(root)}: links to {target}, which has no such heading"


def headings(page: Path) -> set[str]:
    """The anchors of a page, as GitHub and mkdocs make them of its headings."""
    text = _CODE.sub("", page.read_text(encoding="utf-8"))
    plain = (re.sub(r"[^\w\s-]", "", heading.lower()) for heading in _HEADING.findall(text))
    return {re.sub(r"\s+", "-", heading.strip()) for heading in plain}
