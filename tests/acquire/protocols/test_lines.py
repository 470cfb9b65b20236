"""The configurable line parser: rules of one's own, and what is wrong with them."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from acquire.errors import ConfigError
from acquire.load_sample import LoadFlag
from acquire.protocols.lines import PRESETS, load_preset, parser_from
from tests.acquire.protocols.conversation import parser

OWN = r"""
pattern = 'W(?P<sign>[-+]) *(?P<value>[0-9,]+)(?P<unit>kN|N)(?P<flag>[?N]?)( t=(?P<ms>[0-9]+))?'
overload = "OL|--"
underload = "UL"
error = "Err"
unstable = "?"
net = "N"
decimal = "comma"
scale = 2
ends = "cr"
poll = 'W\r'
tare = 'T\r\n'
"""


@pytest.fixture
def own(tmp_path: Path) -> str:
    path = tmp_path / "mine.toml"
    path.write_text(OWN)
    return f"preset={path}"


def test_a_preset_of_ones_own(own: str) -> None:
    made = parser("lines", own)
    made.feed(b"\r")
    readings = made.feed(b"W- 12,5kN?\rW+3NN t=250\rOL\rW UL\rErr 5\rW+1,2,3N\r")
    values = [reading.value for reading in readings]
    assert values == pytest.approx([-25.0, 6.0, math.nan, math.nan, math.nan, math.nan], nan_ok=True)
    assert [reading.flags for reading in readings] == [
        LoadFlag.UNSTABLE,
        LoadFlag.NET,
        LoadFlag.OVERLOAD,
        LoadFlag.UNDERLOAD,
        LoadFlag.ERROR,
        LoadFlag.ERROR,
    ]
    assert [reading.stable for reading in readings[:2]] == [False, True]
    assert (readings[0].unit, readings[1].unit, readings[1].device_ms) == ("kN", "N", 250.0)


def test_commands_of_a_preset(own: str) -> None:
    assert parser("lines", own).commands == {"poll": b"W\r", "tare": b"T\r\n"}


@pytest.mark.parametrize("name", ["rinstrum", "sartorius", "ohaus", "loadstar", "dillon"])
def test_presets_of_ours_are_sound(name: str) -> None:
    parser_from(load_preset(name))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("unit = 'N'", "needs pattern="),
        ("pattern = '(?P<value>'", "no regular expression"),
        ("pattern = '[0-9]+'", "names no value"),
        ("pattern = '(?P<value>.)'\nends = 'nul'", "ends=nul"),
        ("pattern = '(?P<value>.)'\nscale = 0", "scale=0"),
        ("patern = '(?P<value>.)'", "unknown key 'patern'"),
        ("pattern = ", "mine.toml"),
    ],
)
def test_wrong_rules_are_refused_in_words(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(text)
    with pytest.raises(ConfigError, match=words):
        parser("lines", f"preset={path}")


def test_unknown_presets_list_the_known(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="rinstrum, sartorius"):
        load_preset("nobody")
    with pytest.raises(ConfigError, match="No such file"):
        load_preset(str(tmp_path / "nothing.toml"))
    assert PRESETS.exists()


def test_the_example_reads_the_lines_that_it_shows() -> None:
    path = Path(__file__).parents[3] / "examples" / "own-protocol" / "scale.toml"
    shown = [line[6:] for line in path.read_text().splitlines() if line.startswith("#     ")]
    made = parser("lines", f"preset={path}")
    readings = made.feed("".join(f"{line}\r\n" for line in ["", *shown]).encode())
    assert [reading.value for reading in readings] == pytest.approx([12.345, -0.12, math.nan], nan_ok=True)
    assert [reading.unit for reading in readings] == ["kN", "kN", None]
    assert [reading.flags for reading in readings] == [LoadFlag.NONE, LoadFlag.UNSTABLE, LoadFlag.OVERLOAD]
    assert made.commands["tare"] == b"T\r\n"
