"""One made-up test for the readers and the report of a run."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.live.made_run import make_run


@pytest.fixture(scope="package")
def run_dir(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A tensile test beyond yield, with an event that is not kind."""
    return make_run(
        tmp_path_factory.mktemp("run"), metadata={"specimen": "S1 <b>& so on</b>", "lens": "50 mm"}
    )
