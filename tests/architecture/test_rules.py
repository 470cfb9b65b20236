"""Each rule of the sources, held against made-up sources that breaks it, and one that does not."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

import pytest

from tests.architecture import imports, modules
from tests.architecture.sources import Module, Sources, read_sources

LAYERS = {"live": "", "live.up": "live.down", "live.down": ""}
INTERFACE = '"""A package."""\n\nfrom live.down.inner import Thing\n\n__all__ = ["Thing"]\n'
INNER = "class Thing: ...\n"


def built(root: Path, files: Mapping[str, str]) -> Sources:
    """A package ``live`` with the packages ``up`` and ``down``."""
    named = {
        "__init__": '"""All."""',
        "up/__init__": '"""Up."""',
        "down/__init__": INTERFACE,
        "down/inner": INNER,
    }
    for name, text in {**named, **files}.items():
        path = root / "live" / f"{name}.py"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    return read_sources(root, ["live"])


def module(root: Path, text: str) -> Module:
    return built(root, {"up/one": text})["live.up.one"]


def only(violations: Iterable[str], place: str) -> None:
    """There is one violation, and it begins with the place."""
    (found,) = violations
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
def test_a_package_may_not_import_upwards(tmp_path: Path, text: str) -> None:
    sources = built(tmp_path, {"up/one": "x = 1", "down/two": text})
    only(
        imports.forbidden(sources, LAYERS, {}),
        f"live/down/two.py:{text.count(chr(10)) + 1}: live.down may not",
    )
    assert not list(imports.forbidden(sources, {**LAYERS, "live.down": "live.up"}, {}))
    assert not list(imports.forbidden(sources, {**LAYERS, "live.down": "*"}, {}))
    assert not list(imports.forbidden(sources, LAYERS, {"live.down.two": "live.up"}))


def test_a_circle_is_found_also_one_of_types(tmp_path: Path) -> None:
    back = "def f():\n    from live.up.one import x"
    sources = built(tmp_path, {"up/one": "from live.up.two import y", "up/two": back})
    first, second = sorted(imports.circles(sources))
    assert first.startswith("live/up/one.py:1: imports live.up.two in the circle")
    assert second.startswith("live/up/two.py:2: imports live.up.one in the circle")
    typing = "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from live.up.one import x"
    assert list(imports.circles(built(tmp_path, {"up/two": typing})))
    assert not list(imports.circles(built(tmp_path, {"up/two": ""})))


def test_a_circle_through_an_interface(tmp_path: Path) -> None:
    """Who imports a module of a package runs the package's interface before it."""
    sources = built(
        tmp_path, {"down/inner": "import live.up.one", "up/one": "import live.down.other", "down/other": ""}
    )
    assert len(list(imports.circles(sources))) == 3


def test_packages_in_a_circle() -> None:
    only(imports.circles_of_packages({**LAYERS, "live.down": "live.up.one"}), "packages in a circle: live.")
    assert not list(imports.circles_of_packages(LAYERS))


def test_libraries_numba_and_what_packages_do_without(tmp_path: Path) -> None:
    text = "import h5py\nfrom numba import njit\ndef f():\n    import time\n    from numba import prange"
    sources = built(tmp_path, {"up/one": text})
    only(
        imports.libraries(sources, LAYERS, {"h5py": "live.down"}),
        "live/up/one.py:1: only live.down may import h5py",
    )
    assert not list(imports.libraries(sources, LAYERS, {"h5py": "live.down live.up"}))
    only(imports.numba_at_import(sources, ()), "live/up/one.py:2: loads numba")
    assert not list(imports.numba_at_import(sources, ("live.up",)))
    only(imports.never(sources, {"live": "time queue"}, {}), "live/up/one.py:4: live does without time")
    assert not list(imports.never(sources, {"live.down": "time"}, {}))
    assert not list(imports.never(sources, {"live": "time queue"}, {"live.up": "time"}))


@pytest.mark.parametrize(
    ("interface", "place"),
    [
        (
            "from live.down.inner import Thing\n__all__ = ['Thing']",
            "live/down/__init__.py:1: an interface begins with",
        ),
        ('"""A."""\nfrom live.down.inner import Thing', "live/down/__init__.py:2: an interface exports"),
        ('"""A."""\n__all__ = ["Thing"]', "live/down/__init__.py:1: __all__ has Thing"),
        ('"""A."""\nLIMIT = 3', "live/down/__init__.py:2: an interface holds"),
    ],
)
def test_an_interface_holds_imports_alone(tmp_path: Path, interface: str, place: str) -> None:
    assert any(
        found.startswith(place) for found in modules.interfaces(built(tmp_path, {"down/__init__": interface}))
    )
    assert not list(
        modules.interfaces(
            built(tmp_path, {"down/__init__": INTERFACE, "__init__": '"""A."""\nVERSION = "1"'})
        )
    )


def test_homonyms(tmp_path: Path) -> None:
    sources = built(
        tmp_path, {"up/one": "class Thing: ...\nclass _Other: ...", "up/two": "class _Other: ..."}
    )
    only(modules.homonyms(sources), "Thing names 2 classes: live/down/inner.py, live/up/one.py")


def test_size(tmp_path: Path) -> None:
    sources = built(tmp_path, {"down/two": "x = 1\n" * 4})
    only(modules.crowded(sources, 1), "live/down: 2 modules")
    only(modules.long_modules({"live.down.two": sources["live.down.two"]}, 3), "live/down/two.py:4: 4 lines")


@pytest.mark.parametrize("text", ["other._x", "self.part._x", "made().run._x", "class A:\n    b = B._x"])
def test_another_s_private_attribute(tmp_path: Path, text: str) -> None:
    only(modules.private_reads(module(tmp_path, text)), f"live/up/one.py:{text.count(chr(10)) + 1}: ")


@pytest.mark.parametrize(
    "text", ["self._x", "super()._x", "class A:\n    b = A._x", "row._replace(n=1)", "x.__dict__"]
)
def test_one_s_own_private_attribute(tmp_path: Path, text: str) -> None:
    assert not list(modules.private_reads(module(tmp_path, text)))


def test_private_names_and_calls(tmp_path: Path) -> None:
    only(
        modules.private_imports(module(tmp_path, "from live.down.inner import _Thing")),
        "live/up/one.py:1: _Thing",
    )
    only(modules.calls(module(tmp_path, "\neval('1')"), {"eval"}), "live/up/one.py:2: calls eval()")
    only(modules.pickles(module(tmp_path, "load(allow_pickle=True)")), "live/up/one.py:1: allow_pickle")
    assert not list(modules.pickles(module(tmp_path, "load(allow_pickle=False)")))


DEAD = ['"live.cli:nothing"', '"live.nothing:main"', '("live.cli", "nothing")', '"live.nothing"']


@pytest.mark.parametrize("text", DEAD)
def test_strings_that_name_nothing(tmp_path: Path, text: str) -> None:
    assert any(
        found.startswith("live/up/one.py:1: ") for found in modules.dead_strings(module(tmp_path, text))
    )
    alive = text.replace("live.nothing", "live.cli").replace("nothing", "main")
    assert not list(modules.dead_strings(module(tmp_path, alive)))
