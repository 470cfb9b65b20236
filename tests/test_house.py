"""The laws of the house, held against its sources. The rooms are in ``tests/house/rooms.py``."""

from __future__ import annotations

import subprocess
import sys
import tomllib
from collections.abc import Iterable
from pathlib import Path

import pytest

from tests.house import importing, shape
from tests.house.rooms import (
    COMPILED,
    DOORS,
    EXCEPT,
    LIBRARIES,
    MANY_FILES,
    MAY_START,
    MOST_FILES,
    MOST_LINES,
    NEVER,
    PACKAGES,
    PRIVATE,
    ROOMS,
    STARTED,
    TO_COME,
)
from tests.house.sources import House, read_house, room_of

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def house() -> House:
    return read_house(ROOT, PACKAGES)


def none_of(breaches: Iterable[str]) -> None:
    found = list(breaches)
    assert not found, "\n" + "\n".join(found)


def test_every_room_has_its_line(house: House) -> None:
    folders = {name for name, module in house.items() if module.is_face}
    assert folders <= set(ROOMS), "a new room needs its line in tests/house/rooms.py"
    assert set(ROOMS) <= set(house) | TO_COME, "a line without a room"


def test_the_lines_make_no_circle() -> None:
    none_of(importing.circles_of_rooms(ROOMS))


def test_what_is_started_is_started_by_a_command() -> None:
    for room, words in ROOMS.items():
        assert set(words.split()) & STARTED <= MAY_START.get(room, set()), room


def test_rooms_import_what_their_line_says(house: House) -> None:
    none_of(importing.strangers(house, ROOMS, DOORS))


def test_no_circle_of_modules(house: House) -> None:
    none_of(importing.circles(house))


def test_rooms_are_entered_by_their_face(house: House) -> None:
    none_of(importing.past_the_face(house, ROOMS))


def test_libraries_have_a_home(house: House) -> None:
    none_of(importing.libraries(house, ROOMS, LIBRARIES))


def test_what_rooms_do_without(house: House) -> None:
    """Numerics and the measuring path: no thread, file, device or clock. Nothing from a file is executed."""
    none_of(importing.never(house, NEVER, EXCEPT))


def test_numba_is_loaded_by_compiled_loops_alone(house: House) -> None:
    none_of(importing.numba_at_import(house, COMPILED))


def test_analysis_opens_no_file(house: House) -> None:
    numerics = (module for name, module in house.items() if room_of(name, ["analysis", "live.measure"]))
    none_of(found for module in numerics for found in shape.calls(module, {"open"}))


def test_nothing_from_a_file_is_executed(house: House) -> None:
    """A session of somebody else is data."""
    none_of(found for module in house.values() for found in shape.calls(module, {"eval", "exec"}))
    none_of(found for module in house.values() for found in shape.pickles(module))


def test_faces_hold_imports_alone(house: House) -> None:
    none_of(shape.faces(house))


def test_no_room_is_crowded(house: House) -> None:
    counted = {name: module for name, module in house.items() if room_of(name, ROOMS) not in MANY_FILES}
    none_of(shape.crowds(counted, ROOMS, MOST_FILES))


def test_no_module_is_long(house: House) -> None:
    none_of(shape.long_modules(house, MOST_LINES))


def test_private_means_private(house: House) -> None:
    modules = [module for name, module in house.items() if not room_of(name, PRIVATE)]
    laws = (shape.private_reads, shape.private_imports)
    none_of(found for module in modules for law in laws for found in law(module))


def test_what_strings_name_is_there(house: House) -> None:
    none_of(found for module in house.values() for found in shape.dead_strings(module))


def test_the_command_is_there() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    for target in project["scripts"].values():
        assert shape.why_missing(*target.split(":")) == ""


@pytest.mark.parametrize(
    ("module", "heavy"),
    [
        ("live.cli", "numpy scipy numba cv2 h5py rerun serial matplotlib"),
        ("analysis", "numba llvmlite cv2 h5py rerun serial matplotlib"),
        ("acquire.burst", "numba llvmlite cv2 h5py rerun serial matplotlib"),
    ],
)
def test_imports_nothing_heavy(module: str, heavy: str) -> None:
    """``phasedic --help`` answers at once because the libraries are imported when first used."""
    code = f"import sys, {module}; print(*sorted({set(heavy.split())!r} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, check=True)
    assert done.stdout.strip() == "", f"import {module} loads what should be imported when first used"
