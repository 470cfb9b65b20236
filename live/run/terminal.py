"""A terminal that gives each key at once and without echo: by termios, on Windows by msvcrt."""

from __future__ import annotations

import contextlib
import os
import select
import sys
import time
from typing import Any, Protocol, TextIO


class Terminal(Protocol):
    """Where single keys come from."""

    def set_single_keys(self) -> bool:
        """Set it to single keys, where it is not; whether it is then."""
        ...

    def read(self, seconds: float) -> bytes | None:
        """What is typed within ``seconds`` (UTF-8); None where nothing is, ``b""`` at the end of the terminal."""
        ...

    def restore(self) -> None:
        """Set it as it was before."""
        ...


if sys.platform == "win32":
    import msvcrt

    _POLL_S = 0.02
    _PREFIXES = ("\x00", "\xe0")  # of a key without a letter

    class _Console:
        """The console of Windows, which always gives single keys this way."""

        def set_single_keys(self) -> bool:
            return True

        def read(self, seconds: float) -> bytes | None:
            until = time.monotonic() + seconds
            while not msvcrt.kbhit():
                if time.monotonic() >= until:
                    return None
                time.sleep(_POLL_S)
            key = msvcrt.getwch()
            if key in _PREFIXES:
                msvcrt.getwch()
                return None
            return key.encode()

        def restore(self) -> None: ...

    def terminal_of(stream: TextIO) -> Terminal | None:
        """The terminal of ``stream``, set to single keys; None where that is not possible."""
        return _Console() if stream.isatty() else None

else:

    class _PosixTerminal:
        """A terminal while the program is in the foreground.

        A shell that stopped the program (Ctrl-Z) changes the terminal and leaves it so when the program
        continues: it is set again. In the background the terminal is not changed: that would stop the program.
        """

        def __init__(self, descriptor: int, before: Any) -> None:
            self._descriptor, self._before = descriptor, before

        def set_single_keys(self) -> bool:
            import termios
            import tty

            if not self._in_foreground:
                return False
            try:
                if termios.tcgetattr(self._descriptor)[tty.LFLAG] & termios.ICANON:
                    tty.setcbreak(self._descriptor, termios.TCSADRAIN)
            except (OSError, ValueError, termios.error):
                return False
            return True

        def read(self, seconds: float) -> bytes | None:
            if select.select([self._descriptor], [], [], seconds)[0] and self._in_foreground:
                return os.read(self._descriptor, 256)
            return None

        def restore(self) -> None:
            import termios

            if self._in_foreground:
                with contextlib.suppress(OSError, ValueError, termios.error):
                    termios.tcsetattr(self._descriptor, termios.TCSADRAIN, self._before)

        @property
        def _in_foreground(self) -> bool:
            try:
                return os.tcgetpgrp(self._descriptor) == os.getpgrp()
            except OSError:
                return False

    def terminal_of(stream: TextIO) -> Terminal | None:
        """The terminal of ``stream``, set to single keys; None where that is not possible."""
        try:
            import termios
        except ImportError:  # a system without
            return None
        try:
            terminal = _PosixTerminal(stream.fileno(), termios.tcgetattr(stream.fileno()))
        except (OSError, ValueError, termios.error):
            return None
        return terminal if terminal.set_single_keys() else None
