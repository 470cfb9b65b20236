"""Files and folders that appear complete or not at all."""

from __future__ import annotations

from pathlib import Path

import pytest

from acquire.errors import ConfigError
from live.config.new_files import new_file, new_folder, replaced_file


def test_what_a_killed_command_left_is_named_and_stays(tmp_path: Path) -> None:
    part = tmp_path / "a.part.csv"
    part.write_text("half")
    for new in (new_file, new_folder):
        with (
            pytest.raises(
                ConfigError, match=r"a\.part\.csv is there: another command writes it, or was killed; remove"
            ),
            new(tmp_path / "a.csv"),
        ):
            pass
    with replaced_file(tmp_path / "a.csv") as mine:
        mine.write_text("whole")
    assert (part.read_text(), (tmp_path / "a.csv").read_text()) == ("half", "whole")
