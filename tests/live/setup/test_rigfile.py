"""The rig file: what is changed, what is kept, and that a bad change leaves it as it was."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from acquire.errors import ConfigError
from live.setup import new_rig, write_rig
from live.setup.config import load_config

TEXT = """# of the big frame
[camera]
address = "sim:"  # the left one

[measure]
# what is measured
zoi = 48  # px
step = 16

[gauges.axial]
kind = "line"  # the extensometer
start = [10, 20]
end = [10, 90]
"""


@pytest.fixture
def rig(tmp_path: Path) -> Path:
    path = tmp_path / "rig.toml"
    path.write_text(TEXT)
    return path


def test_a_key_is_changed_and_all_else_is_kept(rig: Path) -> None:
    config = write_rig(rig, {"measure.zoi": 64, "measure.roi": (1, 2, 300, 400), "camera.crop": None})
    assert (config.measure.zoi, config.measure.roi) == (64, (1, 2, 300, 400))
    assert load_config(rig, {}) == config
    kept = rig.read_text()
    assert "zoi = 64  # px" in kept
    for line in ("# of the big frame", '"sim:"  # the left one', "# what is measured", "step = 16"):
        assert line in kept
    assert (rig.parent / "rig.toml.bak").read_text() == TEXT
    assert sorted(p.name for p in rig.parent.iterdir()) == ["rig.toml", "rig.toml.bak"]


def test_gauges_come_and_go(rig: Path) -> None:
    point = {"kind": "zoi", "at": (30.5, 40), "value": None}
    config = write_rig(rig, {"gauges.point": point, "gauges.axial": None})
    assert list(config.gauges) == ["point"]
    assert config.gauges["point"]["at"] == (30.5, 40.0)
    assert list(write_rig(rig, {"gauges.point": None}).gauges) == []


def test_a_new_file_is_made(tmp_path: Path) -> None:
    path = tmp_path / "new.toml"
    gauge = {"start": [1, 2], "end": [1, 50]}
    config = write_rig(path, {"camera.address": "sim:", "gauges.a": gauge, "measure.zoi": 32})
    assert load_config(path, {}) == config
    assert "[gauges.a]" in path.read_text()
    assert not path.with_name("new.toml.bak").exists()


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"measure.zoi": 2}, "measure.zoi = 2 is not possible; allowed: a whole number from 8"),
        ({"measure.zio": 32}, "did you mean zoi?"),
        ({"measure.zoi": 64, "gauges.2x": {}}, "a name has up to 32 letters"),
        ({"measure": 1}, "names a section and a key"),
        ({"nothing.here": 1}, "unknown section"),
    ],
)
def test_what_is_not_possible_changes_nothing(rig: Path, changes: dict[str, Any], says: str) -> None:
    with pytest.raises(ConfigError) as refused:
        write_rig(rig, changes)
    assert says in str(refused.value)
    assert ".part" not in str(refused.value)
    assert rig.read_text() == TEXT
    assert [p.name for p in rig.parent.iterdir()] == ["rig.toml"]


@pytest.mark.parametrize("text", ["[measure\n", "measure = 3\n", "[" * 5000, "a = 1\na = 2\n", "\0"])
def test_a_file_that_is_no_configuration_is_refused(rig: Path, text: str) -> None:
    rig.write_text(text)
    with pytest.raises(ConfigError, match=r"rig\.toml"):
        write_rig(rig, {"measure.zoi": 64})
    assert rig.read_text() == text


def test_a_new_rig_overwrites_nothing(rig: Path, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="nothing is overwritten"):
        new_rig(rig, TEXT)
    with pytest.raises(ConfigError, match="cannot be written"):
        new_rig(tmp_path / "no" / "folder.toml", TEXT)
    assert new_rig(tmp_path / "other.toml", TEXT).measure.zoi == 48
