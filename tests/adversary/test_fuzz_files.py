"""Files of any structure are refused in words or read right: never a traceback, a hang or a wrong number.

Longer: ``PHASEDIC_FUZZ_S=600`` (seconds a file), or ``python -m tests.adversary.fuzz_files session``.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from itertools import count
from pathlib import Path

import pytest

from tests.adversary.fuzz_files import Fuzz, session_fuzz, strain_fuzz

SECONDS = float(os.environ.get("PHASEDIC_FUZZ_S", "20"))


@pytest.mark.slow
@pytest.mark.timeout(2 * SECONDS + 300)
@pytest.mark.parametrize("make", [session_fuzz, strain_fuzz])
def test_files_of_any_structure(tmp_path: Path, make: Callable[[Path], Fuzz]) -> None:
    fuzz = make(tmp_path)
    fuzz.run(count(), time.monotonic() + SECONDS)
    assert not fuzz.bad, "\n".join(fuzz.bad)
    assert fuzz.ends["refused"] > 10 and fuzz.ends["right"] > 2, fuzz.ends
