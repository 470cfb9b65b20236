"""What all tests share: loops compiled ahead, the folder of real image sets, and tests that need the real time."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import hypothesis
import pytest
from _pytest.runner import runtestprotocol

# A second thread of OpenBLAS only waits for a core, most of all where other programs have them: it takes a fifth of
# the time of the tests, and more of a busy machine. Set before numpy is imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# No example has a time limit of its own, which a busy machine would exceed; pytest's is that of the whole test. One
# state of the code has one answer; ``--hypothesis-profile explore`` draws new examples.
for profile, fixed in (("same examples", True), ("explore", False)):
    hypothesis.settings.register_profile(
        profile,
        deadline=None,
        derandomize=fixed,
        suppress_health_check=[hypothesis.HealthCheck.too_slow],
    )
hypothesis.settings.load_profile("same examples")

MEASURING = {"accuracy", "adversary", "analysis", "bench", "contracts", "live"}


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Browsers first: their files take longest, and the last file is waited for with one processor alone."""
    items.sort(key=lambda item: "web" not in item.path.parts)


def pytest_collection_finish(session: pytest.Session) -> None:
    """Compile what the tests need; for the processes of ``-n``, ``pytest_xdist_setupnodes`` has done it."""
    tests = Path(__file__).parent
    measuring = any(item.path.relative_to(tests).parts[0] in MEASURING for item in session.items)
    if measuring and not hasattr(session.config, "workerinput"):
        compile_all()


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_setupnodes() -> None:
    """Compile once for all processes (pytest-xdist), before they start."""
    compile_all()


def compile_all() -> None:
    """Compile in processes of their own, as every command does.

    The process that compiles a loop may get another last digit than those that load it, and some tests compare bits.
    """
    from analysis import PICTURE_KINDS
    from live.setup.compiling import compile_ahead

    compile_ahead(PICTURE_KINDS, phase=True)


TRIED_AGAIN = pytest.StashKey[list[str]]()


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_protocol(item: pytest.Item, nextitem: pytest.Item | None) -> bool | None:
    """Try a ``timed`` test once more where it fails, with new fixtures: another program may have had the cores."""
    if item.get_closest_marker("timed") is None:
        return None
    item.ihook.pytest_runtest_logstart(nodeid=item.nodeid, location=item.location)
    reports = runtestprotocol(item, log=False, nextitem=nextitem)
    if any(report.failed for report in reports):
        item.config.stash.setdefault(TRIED_AGAIN, []).append(item.nodeid)
        item.session._setupstate.teardown_exact(None)
        reports = runtestprotocol(item, log=False, nextitem=nextitem)
    for report in reports:
        item.ihook.pytest_runtest_logreport(report=report)
    item.ihook.pytest_runtest_logfinish(nodeid=item.nodeid, location=item.location)
    return True


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    """Name the tests that were tried again, passed or not."""
    for name in config.stash.get(TRIED_AGAIN, []):
        terminalreporter.write_line(
            f"WARNING: tried again, since the machine may have been busy: {name}", yellow=True
        )


@pytest.fixture(autouse=True)
def no_cameras_of_the_network(monkeypatch: pytest.MonkeyPatch) -> None:
    """Tests ask no network for cameras, but for their own (``make genicam-test``)."""
    if not os.environ.get("PHASEDIC_IN_NAMESPACE"):
        monkeypatch.setattr("acquire.genicam.camera.list_cameras", list)


@pytest.fixture(autouse=True)
def every_frame_is_counted(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Whatever a test does to a live run, its counts add up at the end."""
    module, wrong = sys.modules.get("live.run.camera_run"), list[str]()
    if module is not None:
        outcome = module.CameraRun.outcome

        def checked(run: Any) -> Any:
            found = outcome(run)
            counts = found.run_state.frame_counts
            wrong.extend([] if counts.adds_up else [counts.line()])
            return found

        monkeypatch.setattr(module.CameraRun, "outcome", checked)
    yield
    assert not wrong


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """The image sets named by PHASEDIC_DATA; the test is skipped without them."""
    folder = os.environ.get("PHASEDIC_DATA", "")
    if not folder or not Path(folder).is_dir():
        pytest.skip("PHASEDIC_DATA does not name a folder of image sets")
    return Path(folder)
