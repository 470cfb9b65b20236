"""What all tests share: loops compiled ahead, and the folder of real image sets, where there is one."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

MEASURING = {"accuracy", "adversary", "analysis", "bench", "contracts", "live"}


def pytest_collection_finish(session: pytest.Session) -> None:
    """Compile in processes of their own, as every command does.

    The process that compiles a loop may get another last digit than those that load it, and some tests compare bits.
    """
    tests = Path(__file__).parent
    if any(item.path.relative_to(tests).parts[0] in MEASURING for item in session.items):
        from analysis import PICTURE_KINDS
        from live.setup.compiling import compile_ahead

        compile_ahead(PICTURE_KINDS, phase=True)


@pytest.fixture(autouse=True)
def no_cameras_of_the_network(monkeypatch: pytest.MonkeyPatch) -> None:
    """Tests ask no network for cameras, but for their own (``make genicam-test``)."""
    if not os.environ.get("PHASEDIC_IN_NAMESPACE"):
        monkeypatch.setattr("acquire.genicam.listing.list_cameras", list)


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """The image sets named by PHASEDIC_DATA; the test is skipped without them."""
    folder = os.environ.get("PHASEDIC_DATA", "")
    if not folder or not Path(folder).is_dir():
        pytest.skip("PHASEDIC_DATA does not name a folder of image sets")
    return Path(folder)
