"""Each law of the house, held against a made-up house that breaks it, and one that does not."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

import pytest

from tests.house import importing, shape
from tests.house.sources import House, Module, read_house

ROOMS = {"live": "", "live.up": "live.down", "live.down": ""}
FACE = '"""A room."""\n\nfrom live.down.inner import Thing\n\n__all__ = ["Thing"]\n'
INNER = "class Thing: ...\n"


def built(root: Path, files: Mapping[str, str]) -> House:
    """A package ``live`` with the rooms ``up`` and ``down``."""
    named = {"__init__": '"""All."""', "up/__init__": '"""Up."""', "down/__init__": FACE, "down/inner": INNER}
    for name, text in {**named, **files}.items():
        path = root / "live" / f"{name}.py"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    return read_house(root, ["live"])


def module(root: Path, text: str) -> Module:
    return built(root, {"up/one": text})["live.up.one"]


def only(breaches: Iterable[str], place: str) -> None:
    """There is one breach, and it says where."""
    (found,) = breaches
    assert found.startswith(place), found


@pytest.mark.parametrize(
    "text",
    [
        "from live.up import one",
        "import live.up.one",
        "from ..up import one",
        "def f():\n    from live.up.one import x",
        "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from live.up.one import x",
    ],
)
def test_a_room_may_not_import_upwards(tmp_path: Path, text: str) -> None:
    house = built(tmp_path, {"up/one": "x = 1", "down/two": text})
    only(
        importing.strangers(house, ROOMS, {}),
        f"live/down/two.py:{text.count(chr(10)) + 1}: live.down may not",
    )
    assert not list(importing.strangers(house, {**ROOMS, "live.down": "live.up"}, {}))
    assert not list(importing.strangers(house, {**ROOMS, "live.down": "*"}, {}))
    assert not list(importing.strangers(house, ROOMS, {"live.down.two": "live.up"}))


def test_a_circle_is_found_and_a_type_makes_none(tmp_path: Path) -> None:
    back = "def f():\n    from live.up.one import x"
    house = built(tmp_path, {"up/one": "from live.up.two import y", "up/two": back})
    first, second = sorted(importing.circles(house))
    assert first.startswith("live/up/one.py:1: imports live.up.two in the circle")
    assert second.startswith("live/up/two.py:2: imports live.up.one in the circle")
    typing = "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from live.up.one import x"
    assert not list(importing.circles(built(tmp_path, {"up/two": typing})))


def test_a_circle_through_a_face(tmp_path: Path) -> None:
    """Who imports a module of a room runs the room's face before it."""
    house = built(
        tmp_path, {"down/inner": "import live.up.one", "up/one": "import live.down.other", "down/other": ""}
    )
    assert len(list(importing.circles(house))) == 3


def test_rooms_in_a_circle() -> None:
    only(importing.circles_of_rooms({**ROOMS, "live.down": "live.up.one"}), "rooms in a circle: live.")
    assert not list(importing.circles_of_rooms(ROOMS))


@pytest.mark.parametrize(
    ("text", "free"),
    [
        ("from live.down.inner import Thing", False),
        ("from live.down import Other", False),
        ("from live.down import Thing", True),
        ("from live.down.fast_loops import run", True),
        ("from live.down.fast import run", True),
    ],
)
def test_a_room_is_entered_by_its_face(tmp_path: Path, text: str, free: bool) -> None:
    loops = {"down/fast_loops": "import numba", "down/fast": "from analysis.compiled.loops import compiled"}
    house = built(tmp_path, {"up/one": text, **loops})
    assert len(list(importing.past_the_face(house, ROOMS))) == (not free)


def test_a_module_that_the_face_exports_is_free(tmp_path: Path) -> None:
    face = '"""A room."""\n\nfrom live.down import inner\n\n__all__ = ["inner"]\n'
    house = built(tmp_path, {"up/one": "from live.down.inner import Thing", "down/__init__": face})
    assert not list(importing.past_the_face(house, ROOMS))


def test_libraries_numba_and_what_rooms_do_without(tmp_path: Path) -> None:
    text = "import h5py\nfrom numba import njit\ndef f():\n    import time\n    from numba import prange"
    house = built(tmp_path, {"up/one": text})
    only(
        importing.libraries(house, ROOMS, {"h5py": "live.down"}),
        "live/up/one.py:1: only live.down may import h5py",
    )
    assert not list(importing.libraries(house, ROOMS, {"h5py": "live.down live.up"}))
    only(importing.numba_at_import(house, ()), "live/up/one.py:2: loads numba")
    assert not list(importing.numba_at_import(house, ("live.up",)))
    only(importing.never(house, {"live": "time queue"}, {}), "live/up/one.py:4: live does without time")
    assert not list(importing.never(house, {"live.down": "time"}, {}))
    assert not list(importing.never(house, {"live": "time queue"}, {"live.up": "time"}))


@pytest.mark.parametrize(
    ("face", "place"),
    [
        (
            "from live.down.inner import Thing\n__all__ = ['Thing']",
            "live/down/__init__.py:1: a face begins with",
        ),
        ('"""A."""\nfrom live.down.inner import Thing', "live/down/__init__.py:2: a face exports"),
        ('"""A."""\n__all__ = ["Thing"]', "live/down/__init__.py:1: __all__ has Thing"),
        ('"""A."""\nLIMIT = 3', "live/down/__init__.py:2: a face holds"),
    ],
)
def test_a_face_holds_imports_alone(tmp_path: Path, face: str, place: str) -> None:
    assert any(found.startswith(place) for found in shape.faces(built(tmp_path, {"down/__init__": face})))
    assert not list(
        shape.faces(built(tmp_path, {"down/__init__": FACE, "__init__": '"""A."""\nVERSION = "1"'}))
    )


def test_size(tmp_path: Path) -> None:
    house = built(tmp_path, {"down/two": "x = 1\n" * 4})
    only(shape.crowds(house, ROOMS, 2), "live/down: 3 files")
    only(shape.long_modules({"live.down.two": house["live.down.two"]}, 3), "live/down/two.py:4: 4 lines")


@pytest.mark.parametrize("text", ["other._x", "self.part._x", "made().run._x", "class A:\n    b = B._x"])
def test_another_s_private_attribute(tmp_path: Path, text: str) -> None:
    only(shape.private_reads(module(tmp_path, text)), f"live/up/one.py:{text.count(chr(10)) + 1}: ")


@pytest.mark.parametrize(
    "text", ["self._x", "super()._x", "class A:\n    b = A._x", "row._replace(n=1)", "x.__dict__"]
)
def test_one_s_own_private_attribute(tmp_path: Path, text: str) -> None:
    assert not list(shape.private_reads(module(tmp_path, text)))


def test_private_names_and_calls(tmp_path: Path) -> None:
    only(
        shape.private_imports(module(tmp_path, "from live.down.inner import _Thing")),
        "live/up/one.py:1: _Thing",
    )
    only(shape.calls(module(tmp_path, "\neval('1')"), {"eval"}), "live/up/one.py:2: calls eval()")
    only(shape.pickles(module(tmp_path, "load(allow_pickle=True)")), "live/up/one.py:1: allow_pickle")
    assert not list(shape.pickles(module(tmp_path, "load(allow_pickle=False)")))


DEAD = ['"live.cli:nothing"', '"live.nothing:main"', '("live.cli", "nothing")', '"live.nothing"']


@pytest.mark.parametrize("text", DEAD)
def test_strings_that_name_nothing(tmp_path: Path, text: str) -> None:
    assert any(found.startswith("live/up/one.py:1: ") for found in shape.dead_strings(module(tmp_path, text)))
    alive = text.replace("live.nothing", "live.cli").replace("nothing", "main")
    assert not list(shape.dead_strings(module(tmp_path, alive)))
