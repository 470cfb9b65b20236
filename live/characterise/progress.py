"""How far an experiment has come, on one line of the terminal."""

from __future__ import annotations

from typing import TextIO

BAR = 24


class Progress:
    """A bar on a terminal, a line an experiment elsewhere; called with the share done."""

    def __init__(self, name: str, screen: TextIO | None) -> None:
        self._name, self._screen = name, screen
        self._live = screen is not None and screen.isatty()
        self(0.0)

    def __call__(self, share: float) -> None:
        if self._live:
            filled = round(BAR * min(max(share, 0.0), 1.0))
            self._write(f"\r{self._name:12} [{'#' * filled}{'.' * (BAR - filled)}] {100 * share:3.0f} %")

    def done(self, words: str) -> None:
        """The experiment is finished."""
        if self._live:
            self(1.0)
            self._write(f"  {words}\n")
        else:
            self._write(f"{self._name:12} {words}\n")

    def _write(self, text: str) -> None:
        if self._screen is not None:
            print(text, end="", file=self._screen, flush=True)
