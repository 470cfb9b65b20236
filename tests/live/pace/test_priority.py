"""A thread is made nicer alone."""

from __future__ import annotations

import os
import sys
import threading

import pytest

from live.pace import yield_to_others


@pytest.mark.skipif(sys.platform != "linux", reason="threads have a nice value of their own on Linux only")
def test_only_the_calling_thread_becomes_nicer() -> None:
    found: list[int] = []

    def work() -> None:
        yield_to_others(3)
        found.append(os.getpriority(os.PRIO_PROCESS, threading.get_native_id()))

    before = os.getpriority(os.PRIO_PROCESS, 0)
    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert found == [min(before + 3, 19)]
    assert os.getpriority(os.PRIO_PROCESS, 0) == before
