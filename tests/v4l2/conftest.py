"""The tests of this folder run through ``make v4l2-test`` alone: inside the machine, then outside."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

collect_ignore = []
if not os.environ.get("PHASEDIC_IN_VM"):
    collect_ignore.append("inside")
if os.environ.get("PHASEDIC_IN_VM") or not os.environ.get("PHASEDIC_VM_KEPT"):
    collect_ignore.append("outside")


@pytest.fixture(scope="session")
def kept() -> Path:
    """The folder that both sides see: pictures come from it, sessions go into it."""
    return Path(os.environ["PHASEDIC_VM_KEPT"])
