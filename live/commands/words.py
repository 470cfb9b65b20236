"""Words of a command line as people type and drop them: quotes that stayed, and patterns that the shell expanded."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from acquire.errors import ConfigError

OF_PICTURES = ("replay", "check", "scale", "lens", "readout", "study", "average", "init", "run", "page")
"""Commands with one source of pictures: many files stand for it."""
OF_SOURCES = ("--camera", "--back", "--beside")


def understood(argv: Sequence[str]) -> list[str]:
    """The words without quotes that were dropped with a path, and many pictures as the one source that they are.

    Raises
    ------
    ConfigError
        The pictures are neither a folder nor a pattern.
    """
    words = [_bare(word) for word in argv]
    if not words or words[0] not in OF_PICTURES:
        return words
    joined: list[str] = []
    while words:
        count = 0
        while count < len(words) and Path(words[count]).suffix and not words[count].startswith("-"):
            count += 1
        if count > 1 and all(map(os.path.isfile, words[:count])):
            of_option = bool(joined) and joined[-1].startswith("-") and joined[-1] not in OF_SOURCES
            joined += _joined(words[:count], of_option)
        else:
            count = max(count, 1)
            joined += words[:count]
        del words[:count]
    return joined


def _bare(word: str) -> str:
    if word[:1] not in ("'", '"') and not word.startswith("file://") and not word.endswith("/"):
        return word
    from acquire.addresses import as_typed

    return as_typed(word)


def _joined(files: Sequence[str], of_option: bool) -> list[str]:
    """The source of all files; the first of them may be the value of the option before."""
    for own in (1, 0) if of_option else (0,):
        if source := _source(files[own:]):
            return [*files[:own], source]
    example = Path(files[-1]).with_stem("*")
    raise ConfigError(
        "{n} files are neither a folder nor a pattern; quote the pattern: '{example}'", len(files), example
    )


def _source(files: Sequence[str]) -> str:
    """The folder or the pattern whose pictures are exactly those of ``files``; else empty."""
    from acquire.files.folder import SUFFIXES, listed

    pictures = {Path(file) for file in files if Path(file).suffix.lower() in SUFFIXES}
    if not pictures:
        return ""
    ends, folder = {path.suffix for path in pictures}, str(Path(files[-1]).parent)
    start = os.path.commonprefix([str(path) for path in pictures])  # noqa: RUF071 (of the letters)
    pattern = f"{start}*{ends.pop() if len(ends) == 1 else ''}"
    return next((source for source in (folder, pattern) if set(listed(source)) == pictures), "")
