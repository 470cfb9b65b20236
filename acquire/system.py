"""What differs between operating systems: signals, processes, priorities, processor and memory use, disk and ports.

No other module asks which system this is, but for the terminal (``live.commands.attended``) and V4L2, which is Linux.
Where there is no /proc, processor and memory use are read by psutil; without it they are not known.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import select
import signal
import socket
import stat
import struct
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from types import FrameType

_START_S = 10.0  # for the memory of another process's socket
_CLOSED_POLL_S = 0.5
_ROOT = Path(__file__).parents[1]
_ARENA_MAX, _POOLS = -8, 2  # malloc.h

if sys.platform == "win32":
    HANGUP: tuple[signal.Signals, ...] = ()
    KILLED = 1
else:
    HANGUP = (signal.SIGHUP,)
    KILLED = -signal.SIGKILL
"""Signals of a closed terminal; the exit code of a killed process."""


def _terminal_errors() -> tuple[type[Exception], ...]:
    if sys.platform == "win32":
        return ()
    else:
        try:
            import termios
        except ImportError:
            return ()
        return (termios.error,)


TERMINAL_ERRORS = _terminal_errors()
"""What ports raise besides OSError."""


# -- signals ----------------------------------------------------------------------------------


@contextlib.contextmanager
def blocked_signals(*signals: signal.Signals) -> Iterator[None]:
    """A process started inside receives ``signals`` only after its own ``unblock_signals``: no early Ctrl-C."""
    if sys.platform == "win32":  # it cannot; the process ignores them from its start on
        yield
    else:
        before = signal.pthread_sigmask(signal.SIG_BLOCK, signals)
        try:
            yield
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)


def unblock_signals(*signals: signal.Signals) -> None:
    """Deliver what ``blocked_signals`` of the parent process keeps back; called by the child."""
    if sys.platform != "win32":
        signal.pthread_sigmask(signal.SIG_UNBLOCK, signals)


@contextlib.contextmanager
def signal_handler(
    handler: Callable[[int, FrameType | None], object] | signal.Handlers, *signals: int
) -> Iterator[None]:
    """``signals`` call ``handler`` within the context, and then what they called before; in the main thread only."""
    before = {number: signal.signal(number, handler) for number in signals}
    try:
        yield
    finally:
        for number, earlier in before.items():
            signal.signal(number, earlier)


# -- processes --------------------------------------------------------------------------------


def python_command(module: str, *words: str) -> list[str]:
    """The command of a Python process that runs ``module``; a module in the working folder is not taken for another."""
    return [sys.executable, "-P", "-m", module, *words]


def python_environment(**more: str) -> dict[str, str]:
    """The environment for ``python_command``, with this code in its path where it is not installed."""
    paths = os.environ.get("PYTHONPATH", "").split(os.pathsep)
    if _ROOT.name not in ("site-packages", "dist-packages"):  # they stand behind Python's own modules
        paths = [str(_ROOT), *paths]
    # An empty entry would be the working folder.
    return {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, paths)), **more}


def start_with_socket(
    command: Sequence[str], environment: Mapping[str, str]
) -> tuple[subprocess.Popen[bytes], socket.socket]:
    """A process, which gets its end by ``inherited_socket``, and our end of the connection to it."""
    ours, its = socket.socketpair()
    with its:
        if sys.platform == "win32":
            process = subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, env=environment
            )
            process.communicate(its.share(process.pid), timeout=_START_S)
        else:
            process = subprocess.Popen(
                command, stdin=its.fileno(), stdout=subprocess.DEVNULL, env=environment
            )
    return process, ours


def inherited_socket() -> socket.socket:
    """The socket from ``start_with_socket``, blocking."""
    if sys.platform == "win32":
        ours = socket.fromshare(sys.stdin.buffer.read())
    else:
        ours = socket.socket(fileno=os.dup(0))
    ours.setblocking(True)
    return ours


def send_within(connection: socket.socket, seconds: float) -> None:
    """Let a blocking send raise BlockingIOError (TimeoutError on Windows) where nothing is taken for so long."""
    if sys.platform == "win32":
        limit = struct.pack("I", round(seconds * 1e3))
    else:
        limit = struct.pack("ll", int(seconds), round(seconds % 1 * 1e6))
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDTIMEO, limit)


def wait_until_closed(connection: socket.socket) -> None:
    """Return once the other end of ``connection`` is closed; what it sends stays to be read."""
    if sys.platform == "win32":
        with contextlib.suppress(OSError):
            while connection.recv(1, socket.MSG_PEEK):
                threading.Event().wait(_CLOSED_POLL_S)
    else:
        poll = select.poll()
        poll.register(connection, 0)  # a closed end is reported in any case
        poll.poll()


def kill_this_process() -> None:
    """End this process at once; a thread that hangs does not stop that."""
    if sys.platform == "win32":
        os.kill(os.getpid(), signal.SIGTERM)  # there this ends a process at once
    else:
        os.kill(os.getpid(), signal.SIGKILL)


def is_running(pid: int) -> bool:
    """Whether there is a process ``pid`` that has not ended."""
    if sys.platform == "win32":  # os.kill(pid, 0) would send it Ctrl-C
        found = subprocess.run(
            ["tasklist", "/fi", f"pid eq {pid}", "/fo", "csv", "/nh"], capture_output=True, check=False
        )
        return f'"{pid}"'.encode() in found.stdout
    else:
        try:
            os.kill(pid, 0)
        except ProcessLookupError:
            return False
        except (PermissionError, OverflowError):
            return True
        return not _has_ended(pid)


def _has_ended(pid: int) -> bool:
    """Whether the process has ended and was not reaped; False without /proc."""
    try:
        state = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rpartition(")")[2]
    except OSError:
        return False
    return state.split()[:1] == ["Z"]


# -- priorities, processors and memory --------------------------------------------------------


def cores() -> int:
    """Processor cores that this process may use."""
    if sys.platform == "linux":
        return len(os.sched_getaffinity(0))
    else:
        return os.cpu_count() or 1


def lower_priority(nice: int) -> None:
    """Raise the nice value of the calling thread by ``nice``; without privileges this cannot be undone.

    Only on Linux a thread has a nice value of its own.
    """
    if sys.platform == "linux":
        thread = threading.get_native_id()
        with contextlib.suppress(OSError):
            os.setpriority(os.PRIO_PROCESS, thread, os.getpriority(os.PRIO_PROCESS, thread) + nice)


def lowest_priority(nice: int = 19) -> None:
    """Give this process the nice value ``nice``; on Windows that has no effect."""
    if sys.platform != "win32":
        os.nice(nice - os.nice(0))


def processor_times() -> tuple[float, float] | None:
    """Processor time of all programs, and of our child processes, so far, s; None where it is not known."""
    if sys.platform == "linux":
        try:
            tick = os.sysconf("SC_CLK_TCK")
            fields = [int(word) for word in Path("/proc/stat").read_text().split("\n", 1)[0].split()[1:]]
            # user, nice, system, (idle, iowait), irq, softirq
            return sum(fields[i] for i in (0, 1, 2, 5, 6)) / tick, sum(map(_ticks, _children())) / tick
        except (OSError, ValueError, IndexError):
            return None
    else:
        return _times_by_psutil()


def _children() -> list[str]:
    found: list[str] = []
    for task in Path("/proc/self/task").iterdir():
        with contextlib.suppress(OSError):  # it has just ended
            found += (task / "children").read_text().split()
    return found


def _ticks(pid: str) -> int:
    """User and system time of a process, in ticks; 0 where it has just ended."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return 0
    return int(fields[11]) + int(fields[12])


def _times_by_psutil() -> tuple[float, float] | None:
    try:
        import psutil
    except ImportError:
        return None
    used = psutil.cpu_times()
    children = 0.0
    for child in psutil.Process().children():
        with contextlib.suppress(psutil.Error):  # it has just ended
            times = child.cpu_times()
            children += times.user + times.system
    return sum(used) - used.idle - getattr(used, "iowait", 0.0), children


def limit_memory_pools() -> None:
    """Let the C library (glibc) keep memory in two pools, unless the environment gives a number.

    It makes one for each thread else, each with free room of its own, which grows over hours.
    """
    if sys.platform == "linux" and "MALLOC_ARENA_MAX" not in os.environ:
        with contextlib.suppress(OSError, AttributeError):  # another C library
            ctypes.CDLL(None).mallopt(_ARENA_MAX, _POOLS)


def memory_MiB() -> float:
    """Resident memory of this process; NaN where it is not known."""
    try:
        pages = int(Path("/proc/self/statm").read_text().split()[1])
        return pages * _page_bytes() / 2**20
    except (OSError, ValueError, IndexError):
        return _memory_by_psutil()


def available_MiB() -> float:
    """Memory that this system can still give to a process; NaN where it is not known."""
    try:
        lines = Path("/proc/meminfo").read_text().splitlines()
        return next(int(line.split()[1]) / 2**10 for line in lines if line.startswith("MemAvailable:"))
    except (OSError, ValueError, IndexError, StopIteration):
        return float("nan")


def _page_bytes() -> int:
    if sys.platform == "win32":
        return 4096  # never asked: it has no /proc
    else:
        return os.sysconf("SC_PAGE_SIZE")


def _memory_by_psutil() -> float:
    try:
        import psutil
    except ImportError:
        return float("nan")
    return float(psutil.Process().memory_info().rss / 2**20)


# -- disk and ports ---------------------------------------------------------------------------


def to_disk(file: int) -> None:
    """Bring the content of the open file ``file`` (a descriptor) to its disk; raises OSError where that fails."""
    getattr(os, "fdatasync", os.fsync)(file)


def forget_pages(file: int, size: int) -> None:
    """Free the memory that holds the first ``size`` bytes of a file, where the system can."""
    if sys.platform == "linux":
        os.posix_fadvise(file, 0, size, os.POSIX_FADV_DONTNEED)


def can_write(folder: Path) -> bool:
    """Whether files can be made in ``folder``, which is made where it is not there."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError:
        return False
    return True


def private_folder(name: str) -> Path:
    """A folder of this user alone below the temporary one, the same each time; raises OSError where there is none.

    Where another user, or one who let others write to it, has made it before, it is a new one.
    """
    if sys.platform == "win32":  # there the temporary folder is the user's own
        path = Path(tempfile.gettempdir()) / name
        path.mkdir(exist_ok=True)
        return path
    else:
        path = Path(tempfile.gettempdir()) / f"{name}-{os.getuid()}"
        with contextlib.suppress(FileExistsError):
            path.mkdir(mode=0o700)
        found = path.lstat()
        ours = stat.S_ISDIR(found.st_mode) and found.st_uid == os.getuid() and not found.st_mode & 0o077
        return path if ours else Path(tempfile.mkdtemp(prefix=f"{name}-"))


def open_pty() -> tuple[int, int, str]:
    """A pseudo-terminal that passes bytes as they are: our descriptor, the port's and the port's name.

    Raises
    ------
    OSError
        The system has none.
    """
    if sys.platform == "win32":
        raise OSError("a simulated serial port needs pseudo-terminals (Linux, macOS); choose the load none:")
    else:
        import tty

        ours, port = os.openpty()
        tty.setraw(port)
        os.set_blocking(ours, False)
        return ours, port, os.ttyname(port)


def group_of(path: Path) -> str:
    """The group that owns a file; "" where there is none."""
    if sys.platform == "win32":
        return ""
    else:
        try:
            return path.group()
        except (OSError, KeyError):
            return ""
