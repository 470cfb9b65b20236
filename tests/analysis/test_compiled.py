"""Compiled loops: their threads and pieces of work, their cache, and explicit vectors against numpy."""

from __future__ import annotations

import ast
import os
import pickle
import shutil
import subprocess
import sys
import time
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numba
import numpy as np
import pytest

import analysis
from analysis.compiled import threads as cores
from analysis.compiled.layer import threading_layer
from analysis.compiled.loops import helper, part, shared, stamp
from analysis.compiled.shares import in_shares, part_of
from analysis.compiled.threads import SHARES, caller, keep_apart, next_piece
from analysis.compiled.vectors import LANES, load, spread, store, total, whole
from analysis.field.grid import profile
from analysis.fit.moments import (
    CHANNELS,
    DEGREES,
    DEGREES_OF,
    DIFFERENCE_ROWS,
    N_PRODUCTS,
    PRODUCT,
    PRODUCT_ROWS,
    SQUARE_ROWS,
    add_difference_columns,
    difference_moments,
    product_moments,
)
from analysis.fit.sensitivity import square_rows
from analysis.fit.shapes import shapes_of
from analysis.kernel.images import with_second_differences

PARTS = 64


@numba.njit(parallel=True)
def where(threads: Any, found: Any) -> Any:
    """Thread and core of each part of a loop, and of its caller."""
    calling = caller()
    for i in numba.prange(PARTS):
        keep_apart(calling)
        threads[i], found[i] = cores._thread(), cores._core()
    return calling


@pytest.fixture
def caller_works() -> None:
    if threading_layer() == "workqueue":
        pytest.skip("the caller of a loop only waits here (test_layer.py)")


def _run() -> tuple[Any, np.ndarray, np.ndarray]:
    threads, found = np.zeros(PARTS, np.int64), np.zeros(PARTS, np.int64)
    return where(threads, found), threads, found


@pytest.mark.usefixtures("caller_works")
@pytest.mark.skipif(not cores.LINUX, reason="threads are told apart on Linux only")
def test_the_threads_of_a_loop_leave_the_core_of_its_caller() -> None:
    allowed = os.sched_getaffinity(0)
    for _ in range(20):
        (thread, mask, taken), threads, found = _run()
        (core,) = np.flatnonzero(taken)
        assert core in allowed
        assert taken[core] == thread
        assert {n for n in range(1024) if int(mask[n // 64]) >> n % 64 & 1} == allowed
        others = threads != thread
        if len(allowed) > 1:
            assert (found[others] != core).all()
            assert others.any() or numba.get_num_threads() == 1
        time.sleep(0.005)  # long enough for threads to fall asleep
    assert os.sched_getaffinity(0) == allowed, "the caller may go where it could"


@pytest.mark.usefixtures("caller_works")
@pytest.mark.skipif(not cores.LINUX, reason="threads are told apart on Linux only")
def test_on_one_core_they_stay() -> None:
    allowed = os.sched_getaffinity(0)
    try:
        os.sched_setaffinity(0, {min(allowed)})
        (_, _, taken), _, found = _run()
        assert np.flatnonzero(taken).tolist() == [min(allowed)]
        assert set(found) <= allowed
    finally:
        os.sched_setaffinity(0, allowed)


PACKAGE = Path(analysis.__file__).parent
COMPILERS = ("analysis.compiled.loops", "analysis.compiled.vectors")


def imports_numba(module: Path) -> bool:
    """Whether a module imports numba, or what compiles with it, when it is imported itself."""
    nodes = ast.parse(module.read_text(encoding="utf-8")).body
    names = [n.module or "" for n in nodes if isinstance(n, ast.ImportFrom)]
    names += [alias.name for n in nodes if isinstance(n, ast.Import) for alias in n.names]
    return any(name.split(".")[0] == "numba" or name.startswith(COMPILERS) for name in names)


COMPILED = sorted(m.relative_to(PACKAGE).as_posix() for m in PACKAGE.rglob("*.py") if imports_numba(m))
# Their constants are part of the compiled code.
CONSTANTS = ["fit/validity.py", "fit/kernel_args.py", "picture/splines.py"]


@pytest.fixture(scope="module")
def copied(tmp_path_factory: pytest.TempPathFactory) -> Path:
    ignore = shutil.ignore_patterns("__pycache__")
    return Path(shutil.copytree(PACKAGE, tmp_path_factory.mktemp("stamp") / "analysis", ignore=ignore))


def test_modules_with_compiled_code_were_found() -> None:
    assert {"compiled/loops.py", "compiled/vectors.py", "picture/warp.py", "follow/hill_climb.py"} <= set(
        COMPILED
    )


@pytest.mark.parametrize("module", [*COMPILED, *CONSTANTS])
def test_a_change_of_any_module_with_compiled_code_changes_the_stamp(copied: Path, module: str) -> None:
    before = stamp(copied)
    assert stamp(copied) == before
    path = copied / module
    os.utime(path, (path.stat().st_atime, path.stat().st_mtime + 1))
    moved = stamp(copied)
    assert moved != before
    path.write_bytes(path.read_bytes() + b"\n")
    os.utime(path, (0, {name: at for name, at, _ in moved}[module]))
    assert stamp(copied) != moved


def test_what_is_not_compiled_is_not_stamped(copied: Path) -> None:
    assert not [name for name, _, _ in stamp(copied) if name.startswith(("field/", "kernel/", "evaluate/"))]


def test_a_second_process_compiles_nothing() -> None:
    code = (
        "import numpy as np\n"
        "from analysis import PhaseKernel, Roi, ZoiGrid\n"
        "from analysis.fit import iteration, sensitivity, verdict\n"
        "image = np.random.default_rng(0).normal(100, 20, (96, 96)).astype(np.float32)\n"
        "kernel = PhaseKernel(image, ZoiGrid.cover(Roi(8, 8, 80, 80), 32, 16), noise=1.0)\n"
        "kernel.measure(image, start=kernel.measure(image))\n"
        "for loop in (iteration.track.dispatcher, sensitivity.prepare.dispatcher, verdict.judge):\n"
        "    assert len(loop.signatures) == 1, loop\n"
        "    print(sum(loop.stats.cache_hits.values()), sum(loop.stats.cache_misses.values()))\n"
    )
    for _ in range(2):
        done = subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, cwd=PACKAGE.parent, check=False
        )
        assert done.returncode == 0, done.stderr
    assert done.stdout.split() == ["1", "0"] * 3


@numba.njit(parallel=True)
def done_by(times: Any, counters: Any, pieces: int) -> None:
    """How often each piece was done."""
    for share in numba.prange(SHARES):
        piece = next_piece(counters, share, pieces)
        while piece >= 0:
            times[piece] += 1
            piece = next_piece(counters, share, pieces)


@pytest.mark.parametrize("pieces", [0, 1, 3, 1000, 100_001])
def test_each_piece_is_done_once(pieces: int) -> None:
    times, counters = np.zeros(pieces, np.int64), np.zeros(SHARES, np.int64)
    done_by(times, counters, pieces)
    assert (times == 1).all()
    assert counters.sum() >= pieces


@pytest.mark.parametrize("share", [0, 5, SHARES - 1])
def test_a_thread_begins_with_its_own_and_goes_on_with_what_others_left(share: int) -> None:
    counters, pieces = np.zeros(SHARES, np.int64), 10 * SHARES + 3
    other = next_piece(counters, (share + 1) % SHARES, pieces)
    done = [next_piece(counters, share, pieces) for _ in range(pieces)]
    own = range(pieces * share // SHARES, pieces * (share + 1) // SHARES)
    assert done[: len(own)] == list(own)
    assert sorted(done) == [-1, *sorted(set(range(pieces)) - {other})]


RNG = np.random.default_rng(7)
HEIGHT, PITCH = 90, 112


@helper
def every_operation(a: np.ndarray, at: np.uintp, factor: np.float32, out: np.ndarray) -> float:
    v = load(a, at)
    w = spread(factor)
    s = v * w - w
    s += v + w
    store(out, np.uintp(1), s)
    return total(s)


@helper
def of_the_difference(images, samples, at, pitch, g, line, size, rows, columns, out):
    for first in range(0, size, 16):
        count = min(16, size - first)
        add_difference_columns(
            images, samples, at + np.uintp(first) * pitch, pitch, g, np.uintp(first * line), np.uintp(line),
            line, first, count, rows, columns,
        )  # fmt: skip
    return difference_moments(columns, np.uintp(0), rows, line, out)


@part
def halved(x: float) -> float:
    return x / 2


@helper
def quartered(x: float) -> float:
    return halved(halved(x))


def test_a_part_has_code_in_loops_alone() -> None:
    assert quartered(10.0) == 2.5
    with pytest.raises(SystemError):
        halved(10.0)


def test_operations_on_vectors() -> None:
    a, out = RNG.normal(size=LANES + 5).astype(np.float32), np.zeros(LANES + 3, np.float32)
    found = every_operation(a, 3, np.float32(1.5), out)
    expected = a[3 : 3 + LANES] * 1.5 - 1.5 + a[3 : 3 + LANES] + 1.5
    assert out[1:-2] == pytest.approx(expected, rel=1e-6)
    assert (out[0], *out[-2:]) == (0, 0, 0)
    assert found == pytest.approx(expected.sum(), rel=1e-5)


def test_a_two_dimensional_array_is_flat_memory() -> None:
    a, out = RNG.normal(size=(3, LANES)).astype(np.float32), np.zeros(LANES + 3, np.float32)
    every_operation(a, LANES, np.float32(0), out)
    assert np.array_equal(out[1 : 1 + LANES], a[1])


@pytest.mark.parametrize(("size", "rounded"), [(LANES, LANES), (LANES + 1, 2 * LANES), (1, LANES)])
def test_whole_vectors(size: int, rounded: int) -> None:
    assert whole(size) == rounded


@pytest.mark.parametrize("size", [9, 32, 57])
def test_moments_of_the_difference(size: int) -> None:
    images = RNG.normal(size=(4, HEIGHT, PITCH)).astype(np.float32)
    top, left, line = 5, 7, whole(size)
    g = np.full((size, line), 1e3, np.float32)  # what lies beyond the ZOI must not count
    g[:, :size] = RNG.normal(size=(size, size))
    shapes = shapes_of(profile("gaussian", size), line)
    out, columns = np.zeros((CHANNELS, DEGREES, DEGREES)), np.zeros((DIFFERENCE_ROWS, line), np.float32)
    energy = of_the_difference(
        images.ravel(), HEIGHT * PITCH, top * PITCH + left, PITCH, g.ravel(), line, size, shapes.rows, columns, out
    )  # fmt: skip
    second = with_second_differences(images)[4:, top : top + size, left : left + size].astype(float)
    fx, fy, f, raw = images[:, top : top + size, left : left + size].astype(float)
    d, rows = g[:, :size] - raw, shapes.rows[:, :size].astype(float)
    assert energy == pytest.approx(rows[0] @ d**2 @ rows[0], rel=1e-5)
    for channel, (image, degrees) in enumerate(zip((fx, fy, f, 1.0, *second), DEGREES_OF, strict=True)):
        expected = rows @ (d * image) @ rows.T
        for j in range(degrees):
            for i in range(degrees - j):
                assert out[channel, j, i] == pytest.approx(expected[j, i], abs=1e-4 * size)


@pytest.mark.parametrize("order", [1, 2])
def test_moments_of_products(order: int) -> None:
    size = 25
    images = RNG.normal(size=(CHANNELS, HEIGHT, PITCH)).astype(np.float32)
    top, left, line = 11, 3, whole(size)
    window = profile("gaussian", size)
    powers, squares = shapes_of(window, line).powers, square_rows(window, line)
    places = np.array([0, 7, 26], np.uintp)
    of_w, of_q = np.zeros((2, len(places), N_PRODUCTS, PRODUCT_ROWS, PRODUCT_ROWS))
    one = np.ones(3 * line, np.float32)
    columns = np.zeros((PRODUCT_ROWS + SQUARE_ROWS, 3 * line), np.float32)
    product_moments(
        images.ravel(), images.ravel(), one, 0, 0, one, HEIGHT * PITCH, top * PITCH + left, PITCH, size, places,
        powers, squares, order, columns, of_w, of_q,
    )  # fmt: skip
    w, q = powers[:, :size].astype(float), squares[:, :size].astype(float)
    degrees = order, order, 1, 1, 0, 0, 0
    for z, place in enumerate(places.astype(int)):
        parts = images[:, top : top + size, left + place : left + place + size].astype(float)
        parts[3] = 1
        for a in range(CHANNELS):
            for b in range(a, CHANNELS):
                product = parts[a] * parts[b]
                with_shapes = degrees[b] + (3 if a < 2 else degrees[a])
                for found, rows, most in ((of_w, w, with_shapes), (of_q, q, degrees[a] + degrees[b])):
                    expected = rows @ product @ rows.T
                    for y in range(most + 1):
                        for x in range(most + 1 - y):
                            assert found[z, PRODUCT[a, b], y, x] == pytest.approx(expected[y, x], abs=1e-3)


def test_a_measurement_compiles_nothing_that_was_not_compiled_ahead() -> None:
    """What a process compiles for itself may have another last digit than what the next one loads."""
    from analysis import PhaseKernel, Roi, ZoiGrid
    from analysis.kernel.warm_up import _loops

    def compiled() -> list[int]:
        return [len(getattr(loop, "dispatcher", loop).signatures) for loop in _loops(True)]

    from analysis import warm_up

    warm_up()
    before = compiled()
    image = RNG.normal(128, 30, (256, 256)).astype(np.uint8)
    for step in (4, 8):
        kernel = PhaseKernel(image, ZoiGrid.cover(Roi(8, 8, 240, 240), 32, step), noise=1.0)
        field = kernel.measure(image, noise=1.0)
        noisy = np.clip(image + RNG.normal(0, 3, image.shape), 0, 255).astype(np.uint8)
        kernel.measure(noisy, field, noise=1.0)
        kernel.measure(np.roll(image, 40, 1), field)
    assert compiled() == before


class Args(NamedTuple):
    """As loops have them: arrays and numbers, one within the other."""

    values: Any
    factor: float


@helper
def _times(args: Any, other: tuple[Any, int], done: Any, share: int) -> None:
    first, end = part_of(len(args.values), share)
    for i in range(first, end):
        done[i] += args.factor * args.values[i] + other[0][i, 1] + other[1]


@shared
def times(args: Args, other: tuple[Any, int], done: Any) -> int:
    """Add to ``done``; then go on, alone."""
    in_shares(_times, (args, other, done))
    return len(done)


@helper
def _count(done: Any, counters: Any, by: Any, share: int) -> None:
    piece = next_piece(counters, share, len(done))
    while piece >= 0:
        done[piece] += 1
        by[share] += 1
        piece = next_piece(counters, share, len(done))


@shared
def count(done: Any, by: Any) -> None:
    """Two loops one after the other, of which the second finds all of the first done."""
    in_shares(_count, (done, np.zeros(SHARES, np.int64), by))
    in_shares(_count, (done, np.zeros(SHARES, np.int64), by))


@pytest.mark.parametrize("n", [0, 1, 63, 64, 65, 1000])
def test_every_item_is_done_once_with_its_arguments(n: int) -> None:
    values, beside, done = np.arange(n, dtype=np.float32), np.arange(2.0 * n).reshape(n, 2), np.ones(n)
    assert times(Args(values, 2.5), (beside, 7), done) == n
    np.testing.assert_array_equal(done, 1 + 2.5 * np.arange(n) + (2 * np.arange(n) + 1) + 7)


@pytest.mark.parametrize("n", [0, 1, 10, 999])
def test_pieces_are_taken_once_in_each_of_two_loops(n: int) -> None:
    done, by = np.zeros(n, np.int64), np.zeros(SHARES, np.int64)
    count(done, by)
    np.testing.assert_array_equal(done, 2)
    assert by.sum() == 2 * n


def test_the_parts_of_shares_join() -> None:
    for n in (0, 1, 64, 1001):
        parts = [part_of.py_func(n, share) for share in range(SHARES)]
        assert parts[0][0] == 0
        assert parts[-1][1] == n
        assert all(a[1] == b[0] for a, b in pairwise(parts))


# What pickle does with it: import gone.module, then fail.
NAMES_WHAT_IS_GONE = b"cgone.module\nThing\n."


@helper
def twice(x: float) -> float:
    return 2 * x


@pytest.mark.parametrize("version", [numba.__version__, f"{numba.__version__}, loops 0123456789ab"])
def test_an_index_of_other_modules_is_not_read(
    version: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    index = tmp_path / "twice.nbi"
    index.write_bytes(pickle.dumps(version) + NAMES_WHAT_IS_GONE)
    file = twice._cache._cache_file
    monkeypatch.setattr(file, "_index_path", str(index))
    assert file._load_index() == {}
