"""The tests of a campaign (paths, globs and lists), and stale staging folders."""

from __future__ import annotations

import platform
import subprocess
import sys
import time
from pathlib import Path

import pytest

from acquire.errors import ConfigError, DataError, PhasedicError
from live.replay.batch.test_list import find_tests
from live.replay.batch.workdir import staging_dirs, sweep


@pytest.fixture
def place(tmp_path: Path) -> Path:
    for name in ("a/session.h5", "b/session.h5", "day/a/session.h5", "shots/0.tif", "shots/1.tif", "c.h5"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
    return tmp_path


def test_paths_and_globs(place: Path) -> None:
    found = find_tests([f"{place}/?/session.h5", str(place / "shots"), str(place / "c.h5")])
    assert [(test.name, Path(test.source).relative_to(place)) for test in found] == [
        ("a", Path("a/session.h5")),
        ("b", Path("b/session.h5")),
        ("shots", Path("shots")),
        ("c", Path("c.h5")),
    ]
    assert [test.source for test in find_tests([str(place / "a")])] == [str(place / "a/session.h5")]
    assert len(find_tests([str(place / "a"), str(place / "a" / "session.h5")])) == 1


def test_names_that_are_the_same_are_told_apart(place: Path) -> None:
    found = find_tests([f"{place}/**/session.h5"])
    assert [test.name for test in found] == [f"{place.name}-a", "b", "day-a"]


def test_a_list(place: Path) -> None:
    (place / "list.csv").write_text(
        "# pulled on Monday\nsource,name,load,specimen.width_mm,measure.zoi,metadata.material\n"
        "shots,S1,forces.csv,20,48,steel\na,,,12.5,,\n",
        encoding="utf-8",
    )
    (place / "list.toml").write_text(
        '[[test]]\nsource = "files:shots/*.tif?bits=8"\nname = "S2"\nreference = "ref.tif"\n'
        'specimen.width_mm = 20\n[[test]]\nsource = "b"\n',
        encoding="utf-8",
    )
    first, second, third, fourth = find_tests([str(place / "list.csv"), str(place / "list.toml")])
    assert (first.name, first.source, first.forces) == ("S1", str(place / "shots"), str(place / "forces.csv"))
    assert first.overrides == {"specimen.width_mm": 20, "measure.zoi": 48, "metadata.material": "steel"}
    assert (second.name, second.source) == ("a", str(place / "a" / "session.h5"))
    assert second.overrides == {"specimen.width_mm": 12.5}
    assert (third.source, third.reference) == (f"files:{place}/shots/*.tif?bits=8", str(place / "ref.tif"))
    assert third.overrides == {"specimen.width_mm": 20}
    assert fourth.name == "b"


@pytest.mark.parametrize(
    ("list_", "kind", "says"),
    [
        ("source,wdith\na,3\n", ConfigError, "unknown: wdith"),
        ("name\nS1\n", ConfigError, "no source"),
        ("source,name\na,S1\nb,S1\n", ConfigError, "2 tests are called S1"),
        ("source,name\na,../S1\n", ConfigError, "cannot be called that"),
        ("source,name\na,.S1\n", ConfigError, "cannot be called that"),
        ("source\na,b,c\n", DataError, "more cells than the heading"),
        ("source\n", DataError, "lists no test"),
    ],
)
def test_lists_that_are_refused(place: Path, list_: str, kind: type[PhasedicError], says: str) -> None:
    (place / "list.csv").write_text(list_, encoding="utf-8")
    with pytest.raises(kind, match=says):
        find_tests([str(place / "list.csv")])


def test_what_is_no_test(place: Path) -> None:
    with pytest.raises(ConfigError, match="no session and no folder"):
        find_tests([str(place / "nowhere*")])
    with pytest.raises(ConfigError, match="is one picture"):
        find_tests([str(place / "shots" / "*.tif")])
    (place / "bad.toml").write_text("[[test]\n", encoding="utf-8")
    with pytest.raises(DataError, match=r"bad\.toml: the list cannot be read"):
        find_tests([str(place / "bad.toml")])


@pytest.mark.skipif(sys.platform != "linux", reason="zombies are told by /proc")
def test_the_part_of_a_zombie_is_stale(tmp_path: Path) -> None:
    with subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE) as child:
        host = platform.node().replace(".", "-") or "host"
        (tmp_path / f".one.{host}.{child.pid}.part").mkdir()
        assert not sweep(tmp_path)  # it lives
        child.kill()
        state = Path(f"/proc/{child.pid}/stat")
        while state.read_text().rpartition(")")[2].split()[0] != "Z":
            time.sleep(0.01)
        assert sweep(tmp_path) == 1
    assert not list(staging_dirs(tmp_path))
