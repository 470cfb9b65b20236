"""The rig file in the making."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from acquire.errors import ConfigError
from live.serve.draft import Draft, counted_up, still, with_setting
from live.setup import load_config, read_mask

RIG = """# the rig of bench 3
[camera]
address = "sim:hole?bits=12"  # the blue one
[measure]
zoi = 48  # found by trial
"""


@pytest.fixture
def draft(tmp_path: Path) -> Draft:
    path = tmp_path / "rig.toml"
    path.write_text(RIG)
    return Draft(load_config(path, {"measure.step": 12}), path, {"measure.step": 12})


def test_saved_with_its_comments_and_loaded_again(draft: Draft) -> None:
    draft.change_all(
        {"measure.burst": 8, "gauges.axial": {"kind": "line", "start": [10, 20], "end": [10, 90]}}
    )
    mask = np.zeros((40, 50), bool)
    mask[5:20, 10:30] = True
    draft.save(mask)
    text = draft.path.read_text()
    assert "# the rig of bench 3" in text and "# the blue one" in text and "# found by trial" in text
    assert draft.path.with_name("rig.toml.bak").read_text() == RIG
    config = load_config(draft.path, {})
    assert (config.measure.zoi, config.measure.step, config.measure.burst) == (48, 12, 8)
    assert config.gauges["axial"]["end"] == (10, 90)
    assert np.array_equal(read_mask(config.measure.mask, 50, 40), mask)
    assert draft.changes == {} and draft.config == config


def test_a_second_mask_is_a_file_of_its_own(draft: Draft) -> None:
    first, second = np.eye(40, dtype=bool), ~np.eye(40, dtype=bool)
    draft.save(first)
    before = load_config(draft.path, {}).measure.mask
    draft.save(second)
    assert np.array_equal(read_mask(before, 40, 40), first)
    assert np.array_equal(read_mask(load_config(draft.path, {}).measure.mask, 40, 40), second)


@pytest.mark.parametrize(
    "changes",
    [
        {"measure.zoi": 4},
        {"measure.zoi": 32, "measure.step": "wide"},
        {"gauges.1a": {"kind": "line"}},
        {"gauges.a": {"kind": "spiral"}},
        {"record.enabled": False},
        {"output.dir": "/etc"},
        {"measure.nothing": 1},
        {"nothing.at": 1},
    ],
)
def test_what_is_impossible_changes_nothing(draft: Draft, changes: dict[str, object]) -> None:
    before, file = draft.config, draft.path.read_text()
    with pytest.raises(ConfigError):
        draft.change_all(changes)
    assert draft.config == before and draft.path.read_text() == file


def test_taken_out(draft: Draft) -> None:
    draft.change_all({"gauges.a": {"kind": "zoi", "at": [5, 5]}, "specimen.width_mm": 20})
    draft.save(None)
    draft.change_all({"gauges.a": None, "specimen.width_mm": None})
    draft.save(None)
    config = load_config(draft.path, {})
    assert config.gauges == {} and config.specimen.width_mm is None


def test_settings_of_an_address() -> None:
    assert with_setting("/dev/video0", "gain", 3) == "/dev/video0?gain=3"
    assert with_setting("/dev/video0?gain=3&fps=30", "gain", 7.5) == "/dev/video0?gain=7.5&fps=30"
    assert with_setting("files:a?b/*.tif", "fps", 3) == "files:a?b/*.tif?fps=3"


def test_only_a_simulated_specimen_has_to_be_held() -> None:
    assert still("/dev/video0?fps=30") == "/dev/video0?fps=30"
    assert "max_strain=0" in still("sim:hole?max_strain=0.01") and "max_strain=0.01" not in still(
        "sim:?max_strain=0.01"
    )


@pytest.mark.parametrize(
    ("name", "following"),
    [("bar-6", "bar-7"), ("bar-009", "bar-010"), ("B7", "B8"), ("bar", "bar-2"), ("3", "4")],
)
def test_counted_up(name: str, following: str) -> None:
    assert counted_up(name) == following
