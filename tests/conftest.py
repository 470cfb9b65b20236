"""What all tests share: the folder of real image sets, where there is one."""

from __future__ import annotations

import os
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """The image sets named by PHASEDIC_DATA; the test is skipped without them."""
    folder = os.environ.get("PHASEDIC_DATA", "")
    if not folder or not Path(folder).is_dir():
        pytest.skip("PHASEDIC_DATA does not name a folder of image sets")
    return Path(folder)
