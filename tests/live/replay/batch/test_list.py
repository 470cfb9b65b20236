"""The tests of a campaign (paths, globs and lists), and stale staging folders."""

from __future__ import annotations

import platform
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from acquire.errors import ConfigError, DataError, PhasedicError
from live.replay.batch.task import Task, staging_dirs, sweep
from live.replay.batch.test_list import find_tests, key_of, key_of_chunk


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


def test_a_list_with_semicolons_may_have_commas_in_its_cells(place: Path) -> None:
    (place / "list.csv").write_text("source;name;metadata.note\na;S,1;cut, then pulled\n", encoding="utf-8")
    (one,) = find_tests([str(place / "list.csv")])
    assert (one.name, dict(one.overrides)) == ("S,1", {"metadata.note": "cut, then pulled"})


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


def recording(folder: Path, **files: bytes) -> Task:
    """A task with files of these contents; the recording is longer than both ends that are looked at."""
    folder.mkdir()
    (folder / "session.h5").write_bytes(files.pop("session", bytes(5 << 19)))
    for name, content in files.items():
        (folder / name).write_bytes(content)
    given = {name: str(folder / name) for name in ("config", "reference", "forces") if name in files}
    mask = {"measure.mask": str(folder / "mask")} if "mask" in files else {}
    return Task("one", str(folder / "out"), str(folder / "session.h5"), **given, overrides=mask)  # type: ignore[arg-type]


OF_A_TEST = {"config": b"zoi", "reference": b"picture", "forces": b"0,1", "mask": b"white"}


@pytest.mark.parametrize(
    "other",
    [
        {"forces": b"0,2"},
        {"config": b"step"},
        {"reference": b"another"},
        {"mask": b"black"},
        {"session": bytes((5 << 19) - 1) + b"x"},
        {"session": b"x" + bytes((5 << 19) - 1)},
        {"session": bytes((5 << 19) + 1)},
    ],
    ids=lambda one: next(iter(one)),
)
def test_a_key_is_of_all_that_the_results_depend_on(tmp_path: Path, other: dict[str, bytes]) -> None:
    key = key_of(recording(tmp_path / "a", **OF_A_TEST))
    assert key == key_of(recording(tmp_path / "b", **OF_A_TEST)), "wherever the files lie"
    assert key != key_of(recording(tmp_path / "c", **OF_A_TEST | other))


def test_a_key_is_of_the_part_and_the_settings_too(tmp_path: Path) -> None:
    task = recording(tmp_path / "a")
    changes: list[dict[str, Any]] = [
        {"start_s": 1.0}, {"end_s": 1.0}, {"as_measured": True}, {"overrides": {"measure.zoi": 32}},
        {"chunk_s": 60.0},
    ]  # fmt: skip
    keys = {key_of(task), *(key_of(replace(task, **change)) for change in changes)}
    assert len(keys) == 1 + len(changes)
    assert key_of(replace(task, name="two", out="elsewhere")) == key_of(task)
    one, other = (key_of_chunk(replace(task, key="k", numbers=(0, 9), run_in=n)) for n in (0, 1))
    assert one != other != key_of_chunk(replace(task, key="k", numbers=(0, 8), run_in=1))


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
