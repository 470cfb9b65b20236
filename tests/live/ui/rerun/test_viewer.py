"""The viewer opens the drawing without an error in any of its views; needs a graphics stack."""

from __future__ import annotations

from pathlib import Path

import pytest

from live.ui.rerun.drawing.sinks import Rates
from tests.live.ui.rerun.screenshot import ViewerGone, screenshot
from tests.live.ui.rerun.test_drawing import draw_a_test, make_setup, scene_into

pytestmark = pytest.mark.slow


def test_the_viewer_shows_every_view_without_error(tmp_path: Path) -> None:
    path, shot = tmp_path / "view.rrd", tmp_path / "shot.png"
    with scene_into({path: Rates(5.0, 5.0)}, make_setup(area_m2=4e-5)) as (scene, _):
        draw_a_test(scene)
    try:
        state = screenshot(str(path), shot, size="1200x800", settle_s=3.0)
    except ViewerGone as reason:
        pytest.skip(str(reason))
    views = {view.name: view for view in state.views}
    tabs = {"exx", "eyy", "exy", "e1 (largest)", "e2 (smallest)", "sigma", "residual", "status"}
    assert {"Now", "Camera", "Stress – strain", "Status", "Events", *tabs} <= set(views)
    assert [(name, view.reports) for name, view in views.items() if view.reports] == []
    assert {line.name for line in state.recordings[0].timelines} >= {"time"}
    assert shot.stat().st_size > 30_000
