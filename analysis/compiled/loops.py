"""How the inner loops are compiled: once per machine, kept in numba's cache, announced.

numba keeps compiled code beside this package where that folder can be written, else in the
user's cache folder; NUMBA_CACHE_DIR overrides both. Importing this module imports numba, so the
rest of the package does that only when a kernel is made. Its files are checked (``acquire.compiled_loops``).
"""

from __future__ import annotations

import ctypes
import hashlib
import logging
import os
import re
from collections.abc import Callable, Iterable
from functools import lru_cache
from pathlib import Path
from threading import Lock
from typing import Any, TypeVar

import numba
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.np.ufunc import parallel as numba_threads
from numpy.typing import NDArray

from acquire.compiled_loops import KeptFile
from analysis.compiled.interruption import go_on
from analysis.compiled.layer import give_start_lock, threading_layer

# Threads that wait by spinning keep the other threads of a live test, and other programs, from their cores: with
# another program at work a frame took twice as long as with threads that soon fall asleep. Read when GNU OpenMP is
# loaded; about 20 us. 22 ms in place of 43 beside another program, 11.3 in place of 10.8 alone (November 2026).
os.environ.setdefault("GOMP_SPINCOUNT", "5000")


give_start_lock(numba_threads)
log = logging.getLogger("analysis")
Array = TypeVar("Array", bound=NDArray[Any])

_PACKAGE = Path(__file__).parents[1]
_COMPILED = re.compile(r"^(?:from|import) (?:numba|analysis\.compiled\.(?:loops|vectors))\b", re.MULTILINE)
# Sums may be reordered for the vector unit, but NaN and infinity keep their meaning.
FAST = {"contract", "reassoc", "nsz", "arcp", "afn"}


def read_only(array: Array) -> Array:
    """The same array as one that is not written to: numba takes what may be for another type."""
    view = array.view()
    view.flags.writeable = False
    return view


def inlined(function: Callable[..., Any]) -> Any:
    """A helper that becomes part of the loops that call it."""
    return numba.njit(function, error_model="numpy", fastmath=FAST, inline="always")


_refuse = ctypes.PYFUNCTYPE(*[ctypes.c_void_p] * 4)(lambda *_: None)
"""What Python calls in place of a part: a SystemError, not the end of the process."""


class _PartLibrary(JITCodeLibrary):  # type: ignore[misc]
    """The code of a part as it was generated: LLVM optimises and translates it with each loop that it is linked into.

    numba would do both for the part too, and again for each function on the way to the loop: a quarter of all.
    """

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int | None:
        return ctypes.cast(_refuse, ctypes.c_void_p).value

    @property
    def codegen(self) -> Any:
        return self  # asked for ``set_env`` alone

    def set_env(self, name: str, environment: Any) -> None:
        """What Python would call it with."""


class _PartCompiler(Compiler):  # type: ignore[misc]
    def define_pipelines(self) -> Any:
        self.state.library = _PartLibrary(self.state.targetctx.codegen(), self.state.func_id.func_qualname)
        return super().define_pipelines()


def part(function: Callable[..., Any]) -> Any:
    """A function called from compiled loops alone, and part of their code; Python must not call it."""
    return numba.njit(
        function, error_model="numpy", fastmath=FAST, no_cpython_wrapper=True, no_cfunc_wrapper=True,
        pipeline_class=_PartCompiler,
    )  # fmt: skip


def helper(function: Callable[..., Any]) -> Any:
    """A function called from compiled loops and from Python; small or inlined by the compiler as it sees fit."""
    return stamped(numba.njit(function, error_model="numpy", fastmath=FAST, cache=True, nogil=True))


def parallel(function: Callable[..., Any]) -> Any:
    """A loop of numba's own over shares, each done by one of the threads.

    Make the body of the loop a function of its own, and give it the share as int64: numba analyses the bodies of such
    loops twice, and would compile it for two types. What takes no time is compiled sooner as ``shared``.
    """
    options = {"error_model": "numpy", "fastmath": FAST, "cache": True, "nogil": True, "parallel": True}
    return ExclusiveLoop(stamped(numba.njit(function, **options)))


def shared(function: Callable[..., Any]) -> Any:
    """A function that lets all threads do their shares of a loop by ``shares.in_shares``."""
    return ExclusiveLoop(helper(function))


class ExclusiveLoop:
    """A loop that all threads of the program take in turn.

    Each uses all cores, so that two at once gain nothing, and where numba finds neither OpenMP nor TBB they
    end the program.
    """

    _turn = Lock()
    _started = False

    def __init__(self, dispatcher: Any) -> None:
        self.dispatcher = dispatcher

    def __call__(self, *arguments: Any) -> Any:
        """Run the loop, once no other one runs; raises ``Abandoned`` where nobody wants it any more."""
        go_on()
        with ExclusiveLoop._turn:
            if not ExclusiveLoop._started:
                threading_layer()
                ExclusiveLoop._started = True
            return self.dispatcher(*arguments)


def stamped(dispatcher: Any) -> Any:
    """The same, compiled anew when any of the compiled modules has changed.

    numba itself compares only the file of the function, and would run the old code of its helpers.
    """
    try:
        file = _cache_file(dispatcher)
        file.__class__ = KeptFile
        file._source_stamp = _own_stamp()
        # An index of other modules is not even read: it may name types that have moved.
        file._version = f"{numba.__version__}, loops {_own_stamp_digest()}"
    except AttributeError:  # numba's own affair: an installed package changes all its files at once
        log.debug("the stamp of numba's cache could not be set")
    return dispatcher


def stamp(package: Path) -> tuple[tuple[str, float, int], ...]:
    """Name, time and size of every module of the folders of a package in which loops are compiled.

    All modules of such a folder: compiled code keeps the values of the constants that it was compiled with.
    """
    folders = {m.parent for m in package.rglob("*.py") if _COMPILED.search(m.read_text("utf-8"))}
    modules = sorted(m for folder in folders for m in folder.glob("*.py"))
    return tuple((m.relative_to(package).as_posix(), m.stat().st_mtime, m.stat().st_size) for m in modules)


@lru_cache(maxsize=1)
def digest() -> str:
    """A hash of the sources of these loops, whatever the times of their files."""
    modules = (_PACKAGE / name for name, _, _ in _own_stamp())
    return hashlib.sha256(b"".join(module.read_bytes() for module in modules)).hexdigest()[:12]


@lru_cache(maxsize=1)
def _own_stamp() -> tuple[tuple[str, float, int], ...]:
    return stamp(_PACKAGE)


@lru_cache(maxsize=1)
def _own_stamp_digest() -> str:
    return hashlib.sha256(repr(_own_stamp()).encode()).hexdigest()[:12]


def is_cached(function: Any, kind: str = "") -> bool:
    """Whether a loop has compiled code, in this process or on disk, for a first argument of type ``kind``."""
    function = getattr(function, "dispatcher", function)
    if any(kind in str(signature[0]) for signature in function.signatures):
        return True
    try:
        index = _cache_file(function)._load_index()
        return any(kind in str(key[0][0]) for key in index)
    except (AttributeError, IndexError, OSError):  # numba's own affair: only the announcement depends on it
        return False


def compiled_since(functions: Iterable[Any], t: float) -> int:
    """How many functions the cache folders of some loops got since ``t``, s since the epoch."""
    folders = set()
    for function in functions:
        try:
            folders.add(Path(_cache_file(getattr(function, "dispatcher", function))._cache_path))
        except AttributeError:  # numba's own affair: only the progress depends on it
            continue
    files = (file for folder in folders for file in folder.glob("*.nbc"))
    return sum(file.stat().st_mtime >= t for file in files)


def _cache_file(dispatcher: Any) -> Any:
    """Where numba keeps the compiled code of a function; it has no public name for its stamp and its index."""
    return dispatcher._cache._cache_file
