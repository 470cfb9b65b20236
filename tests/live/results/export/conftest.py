"""One made-up run for all formats."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.live.made_run import make_run


@pytest.fixture(scope="package")
def run_dir(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Twelve instants of tension along y."""
    return make_run(tmp_path_factory.mktemp("run"), [1e-4 * k for k in range(12)])
