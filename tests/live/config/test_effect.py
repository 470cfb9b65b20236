"""Options without effect are refused, or named."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from acquire.errors import ConfigError
from live.cli import main
from live.config.effect import check_effect, without_forces
from live.config.loading import load_config


@pytest.mark.parametrize(
    ("given", "other"),
    [
        ({"load.lag_s": 0.1}, {"load.address": "sim:"}),
        ({"record.start_above_N": 5.0, "record.armed": True}, {"load.address": "sim:"}),
        ({"operate.token_file": "t"}, {"operate.orders": "5601"}),
        ({"strain_out.format": "csv"}, {"strain_out.udp": "127.0.0.1:5602"}),
        ({"strain_out.channels": ("axial",)}, {"strain_out.tcp": "5600"}),
    ],
)
def test_an_option_needs_what_it_acts_on(given: dict[str, Any], other: dict[str, Any]) -> None:
    with pytest.raises(ConfigError, match="has no effect here; it needs "):
        check_effect(given, load_config(None, given))
    check_effect(given, load_config(None, given | other))
    check_effect({}, load_config(None, given))  # a file that says more than a test uses


@pytest.mark.parametrize("command", ["replay", "batch"])
def test_how_a_file_of_forces_is_read_needs_one(
    command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "a.png").write_bytes(b"")
    assert main([command, str(tmp_path), "--load-unit", "kN", "--out", str(tmp_path / "o")]) == 2
    assert "--load-unit has no effect here; it needs " in capsys.readouterr().err
    assert not (tmp_path / "o").exists()


def test_what_acts_on_forces_is_named_where_there_are_none() -> None:
    assert without_forces({"load.sign": -1, "measure.zoi": 32}) == [
        "note: --load-sign has no effect, since no force is known"
    ]
