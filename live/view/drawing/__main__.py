"""The process: Ctrl-C and a closed terminal are not meant for it."""

from __future__ import annotations

import signal
import sys

if __name__ == "__main__":
    for number in (signal.SIGINT, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    # They were held back until now (live.view.child).
    signal.pthread_sigmask(signal.SIG_UNBLOCK, (signal.SIGINT, signal.SIGHUP))

    from live.view.drawing.process import main

    sys.exit(main())
