"""How a command ends."""

from __future__ import annotations

from live.cli import main


def code_of(words: list[str]) -> int:
    """The exit code of ``phasedic`` with these words, also where it refuses an option."""
    try:
        return main(words)
    except SystemExit as ended:
        return int(str(ended.code))
