"""A process that was forked off after its parent had measured lacks the threads of the parent.

GNU OpenMP then ends the child without an exception, and a pool of such children waits for ever.
"""

from __future__ import annotations

import os


class ForkCheck:
    """In which process the threads of the loops were started."""

    def __init__(self) -> None:
        self._process: int | None = None

    def check(self) -> None:
        """To be called before the loops run; raises RuntimeError where they would not come back."""
        if self._process is None:
            self._process = os.getpid()
        elif self._process != os.getpid():
            raise RuntimeError(
                "this process was forked off after its parent had begun to measure, and lacks its threads; start "
                'processes with multiprocessing.get_context("spawn"), or before the first kernel is made'
            )


FORK_CHECK = ForkCheck()
