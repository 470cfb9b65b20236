"""One made-up test for the readers and the report of a run."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from live.results.run_folder import RunFolder, open_run
from tests.live.made_run import make_run


@pytest.fixture(scope="package")
def run_dir(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A tensile test beyond yield, with an event that is not kind."""
    return make_run(
        tmp_path_factory.mktemp("run"), metadata={"specimen": "S1 <b>& so on</b>", "lens": "50 mm"}
    )


@pytest.fixture
def run(run_dir: Path) -> Iterator[RunFolder]:
    with open_run(run_dir) as opened:
        yield opened
