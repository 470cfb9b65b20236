"""Starts the process; Ctrl-C and a closed terminal do not end it."""

from __future__ import annotations

import signal
import sys

from acquire.system import HANGUP, unblock_signals

if __name__ == "__main__":
    for number in (signal.SIGINT, *HANGUP):
        signal.signal(number, signal.SIG_IGN)
    unblock_signals(signal.SIGINT, *HANGUP)  # blocked by live.ui.rerun.supervisor

    from live.ui.rerun.drawing.process import main

    sys.exit(main())
