"""A camera in its first state before each test, and the pictures made outside."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.v4l2.inside import vivid


@pytest.fixture(autouse=True)
def camera_in_order() -> None:
    """Each test finds the webcam, present and without faults."""
    vivid.put_in_order()


@pytest.fixture(scope="session")
def pictures(kept: Path) -> dict[str, NDArray[Any]]:
    """The rendered pictures: reference, shifted, strained, each with _8 or _12 bits."""
    with np.load(kept / "pictures.npz") as stored:
        return {name: stored[name] for name in stored.files}
