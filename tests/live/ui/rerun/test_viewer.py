"""The viewer opens the drawing without an error in any of its views; needs a graphics stack.

On Debian the packages mesa-vulkan-drivers libvulkan1 libgl1-mesa-dri libxkbcommon-x11-0 libwayland-client0
fonts-dejavu-core.
"""

from __future__ import annotations

import contextlib
import socket
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from live.ui.rerun.drawing.sinks import Rates
from live.ui.rerun.view import viewer_binary
from tests.live.ui.rerun.test_drawing import draw_a_test, make_setup, scene_into

pytestmark = pytest.mark.slow


@contextlib.contextmanager
def headless_viewer(size: str) -> Iterator[Any]:
    """A viewer without a window, as a ``rerun.experimental.ViewerClient``; the test is skipped without one."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    command = [str(viewer_binary()), "--headless", "--port", str(port), "--window-size", size]
    with subprocess.Popen([*command, "--hide-welcome-screen"], stderr=subprocess.DEVNULL) as process:
        try:
            yield _connected(process, f"rerun+http://127.0.0.1:{port}/proxy")
        except (
            ConnectionError
        ):  # it may answer for a moment and end only when it cannot find a graphics device
            pytest.skip("no headless viewer here: it has ended")
        finally:
            process.terminate()


def _connected(process: subprocess.Popen[bytes], address: str, timeout_s: float = 30.0) -> Any:
    from rerun.experimental import ViewerClient

    end = time.monotonic() + timeout_s
    while process.poll() is None and time.monotonic() < end:
        try:
            client = ViewerClient.connect(address)
            client.get_state()
            return client
        except Exception:
            time.sleep(0.3)
    pytest.skip(f"no headless viewer here (ended with {process.poll()})")


def test_the_viewer_shows_every_view_without_error(tmp_path: Path) -> None:
    path, shot = tmp_path / "view.rrd", tmp_path / "shot.png"
    with scene_into({path: Rates(5.0, 5.0)}, make_setup(area_m2=4e-5)) as (scene, _):
        draw_a_test(scene)
    with headless_viewer("1200x800") as client:
        client.open(str(path))
        time.sleep(3.0)
        client.save_screenshot(str(shot))
        state = client.get_state()
    views = {view.name: view for view in state.views}
    tabs = {"exx", "eyy", "exy", "e1 (largest)", "e2 (smallest)", "sigma", "residual", "status"}
    assert {"Now", "Camera", "Stress – strain", "Status", "Events", *tabs} <= set(views)
    assert [(name, view.reports) for name, view in views.items() if view.reports] == []
    assert {line.name for line in state.recordings[0].timelines} >= {"time"}
    assert shot.stat().st_size > 30_000
