"""The tasks of a batch on the workers of a running Dask cluster.

Anyone with access to a scheduler can run any program on its machines and on this one: docs/scale.md. Dask is the
extra ``cluster``.
"""

from __future__ import annotations

import contextlib
import logging
import re
import socket
import uuid
from collections.abc import Iterator, Mapping
from concurrent.futures import Future
from pathlib import Path
from typing import Any

from acquire.errors import ConfigError, DataError
from acquire.text import Message
from acquire.text.message import printable
from live.pipeline.consumer import Screen
from live.replay.batch.row import BatchRow, failed
from live.replay.batch.task import Task, TaskProgress, row_done
from live.replay.batch.test_list import deciding_versions
from live.replay.batch.worker import OnProgress, compile_on_worker, describe_worker, perform_on_worker

log = logging.getLogger(__name__)
RETRIES = 2  # of a task that raised; Dask itself gives one whose worker died to another, three times
_CONNECT_S, _STARTS = 10, 3
_PER_WORKER, _MIN_QUEUED = 4, 200
"""Queued tasks for each worker, and the least in all; with ten thousand at once the scheduler stops responding."""

_ADDRESS = re.compile(r"(?:tcp|tls)://([^/:\[\]]+|\[[0-9A-Fa-f:]+\]):(\d{1,5})")
_REACH_S = 3.0  # for a first connection
_GONE_S = 5.0  # without the scheduler
_QUIET_S = 15.0  # without a task that ends


class Cluster:
    """Performs tasks on the cluster at ``address``; ``on_progress`` is called from a thread.

    Parameters
    ----------
    address : str
        tcp://HOST:PORT, or tls://HOST:PORT with Dask's own configuration.
    out : Path
        Folder of the results, which all workers must have.
    on_progress : callable
    screen : Screen
        Shows what is odd about the workers.

    Raises
    ------
    ConfigError
        Dask is not installed, nothing answers there, it has no workers, they do not have the folder of the results,
        or their versions are others.
    """

    def __init__(self, address: str, out: Path, on_progress: OnProgress, screen: Screen) -> None:
        self._on_progress, self._address, self._screen = on_progress, address, screen
        self._topic = f"phasedic-{uuid.uuid4().hex}"
        self._tasks: dict[str, Task] = {}
        self._left: dict[str, Any] = {}
        self._gone_s = self._quiet_s = 0.0
        self._max_queued = _MIN_QUEUED
        self._client = _connected(address)
        try:
            self._prepare(out)
            self._client.subscribe_topic(self._topic, self._on_event)
        except BaseException:
            self._client.close()
            raise

    @property
    def at_once(self) -> int:
        """Tasks that are worth submitting at once; none without the scheduler."""
        return self._max_queued if self._client.status == "running" else 0

    def submit(self, task: Task) -> Future[BatchRow | None]:
        """Perform ``task``; Dask itself repeats one whose worker died."""
        found: Future[BatchRow | None] = Future()
        self._tasks[task.title] = task
        self._left[task.title] = queued = self._client.submit(
            perform_on_worker, task.to_json(), str(Path.cwd()), self._topic,
            key=f"{task.folder}-{task.key}", retries=RETRIES, pure=False,
        )  # fmt: skip
        queued.add_done_callback(lambda ended: self._take(task, ended, found))
        return found

    def check(self, quiet_s: float) -> None:
        """Note ``quiet_s`` without a task that ends: there may be no workers any more.

        Raises
        ------
        DataError
            The connection to the scheduler is lost.
        """
        running = self._client.status == "running"
        self._quiet_s = self._quiet_s + quiet_s if quiet_s else 0.0
        if self._quiet_s > _QUIET_S and running:
            self._quiet_s = 0.0
            if not self._client.nthreads():
                self._screen.print(Message("{address} has no workers; waiting for some", self._address))
        self._gone_s = 0.0 if running else self._gone_s + quiet_s
        if self._gone_s > _GONE_S:
            raise DataError(
                "{address}: the scheduler has ended; complete tests are kept: start it, and call again",
                self._address,
            )

    def close(self) -> None:
        """End all tasks, also those that run."""
        with contextlib.suppress(Exception):
            if self._left and self._client.status == "running":
                self._client.cancel(list(self._left.values()), force=True)
        with contextlib.suppress(Exception):
            self._client.close(timeout=_GONE_S)

    def _prepare(self, out: Path) -> None:
        token = out / f".{self._topic}"
        token.touch()
        try:
            found = self._ask(describe_worker, str(token))
        finally:
            token.unlink(missing_ok=True)
        check(self._address, found)
        for words in advice(found):
            self._screen.print(words)
        self._max_queued = max(_MIN_QUEUED, _PER_WORKER * len(found))
        self._compile(found)

    def _ask(self, function: Any, *arguments: Any) -> dict[str, Any]:
        try:
            return dict(self._client.run(function, *arguments))
        except Exception as error:  # any error of a worker with another program
            why = printable(f"{type(error).__name__}: {error}")[:200]
            raise ConfigError(
                "{address}: a worker cannot run phasedic ({why}); install the same version there",
                self._address,
                why,
            ) from None

    def _compile(self, found: Mapping[str, Mapping[str, Any]]) -> None:
        """Compile on one worker of each machine, before any task waits for it."""
        last = {answer["host"]: worker for worker, answer in found.items()}
        self._screen.status(Message("compiling on {n} machines, once", len(last)))
        futures = [
            self._client.submit(compile_on_worker, workers=[worker], pure=False) for worker in last.values()
        ]
        self._client.gather(futures, errors="skip")

    # -- the tasks ------------------------------------------------------------------------------

    def _on_event(self, event: tuple[float, Any]) -> None:
        title, *values = event[1]
        if title in self._tasks:
            self._on_progress(self._tasks[title], TaskProgress(*values))

    def _take(self, task: Task, ended: Any, found: Future[BatchRow | None]) -> None:
        """Pass its row on, from a thread of Dask; what is lost with the connection is no failure of the task."""
        row = _row(task, ended)
        if self._client.status == "running" or row.is_done:
            self._left.pop(task.title, None)
            found.set_result(row)


def check_scheduler(address: str) -> None:
    """Connect and disconnect, where no certificate is needed: Dask waits long for a scheduler that is not there.

    Raises
    ------
    ConfigError
        The address is none, or nothing takes connections there.
    """
    found = _ADDRESS.fullmatch(address)
    if found is None:
        raise ConfigError(
            "--scheduler {address}: give tcp://HOST:PORT, as 'dask scheduler' prints it", address
        )
    if address.startswith("tls:"):
        return
    try:
        socket.create_connection((found[1].strip("[]"), int(found[2])), _REACH_S).close()
    except (OSError, OverflowError, UnicodeError) as error:
        raise _no_answer(address, getattr(error, "strerror", None) or error) from None


def _no_answer(address: str, why: object) -> ConfigError:
    shown = printable(str(why))[:200]
    return ConfigError(
        "--scheduler {address}: nothing answers there ({why}); start one with 'dask scheduler'",
        address,
        shown,
    )


def _connected(address: str) -> Any:
    try:
        from distributed import Client, Security
    except ImportError:
        raise ConfigError("--scheduler needs Dask: pip install 'phasedic[cluster]'") from None
    logging.getLogger("distributed").setLevel(logging.CRITICAL)  # our own messages replace its warnings
    if address.startswith("tls:") and not Security().tls_ca_file:
        raise ConfigError(
            "--scheduler {address}: no certificate is known here; set DASK_DISTRIBUTED__COMM__TLS__CA_FILE,"
            " ...CLIENT__CERT and ...CLIENT__KEY (docs/scale.md)",
            address,
        )
    for _ in range(_STARTS):
        try:
            return Client(address, timeout=_CONNECT_S, set_as_default=False)
        except AssertionError:  # Dask waits at most ten seconds for its own thread
            log.debug("Dask's own thread did not start")
        except (OSError, ValueError, TypeError) as error:
            raise _no_answer(address, error) from None
    raise ConfigError(
        "--scheduler {address}: Dask does not start here; this machine is too busy, try again", address
    )


def check(address: str, found: Mapping[str, Mapping[str, Any]]) -> None:
    """Raises ConfigError where there are no workers, or where their results would differ from ours."""
    if not found:
        raise ConfigError(
            "{address}: has no workers; start some with 'dask worker {address} --nthreads 1'", address
        )
    ours = deciding_versions()
    for worker, answer in found.items():
        for package, version in ours.items():
            other = answer["versions"].get(package, "not known")
            if other != version:
                raise ConfigError(
                    "worker {name} has {package} {theirs}, here it is {ours}; the results would not be the same:"
                    " install the same there",
                    printable(worker),
                    package,
                    printable(str(other)),
                    version,
                )
        if answer["slots"] != 1:
            raise ConfigError(
                "worker {name} does {n} tasks at once; start it with --nthreads 1, and --nworkers for more",
                printable(worker),
                answer["slots"],
            )
        if not answer["has_token"]:
            raise ConfigError(
                "worker {name} does not find --out: recordings and results must be on a disk that all machines have"
                " under the same path",
                printable(worker),
            )


def advice(found: Mapping[str, Mapping[str, Any]]) -> Iterator[str]:
    """Notes on settings that make workers slow."""
    wrong = {
        worker: [name for name, value in answer["threads"].items() if value != "1"]
        for worker, answer in found.items()
    }
    wrong = {worker: names for worker, names in wrong.items() if names}
    if wrong:
        worker, names = next(iter(wrong.items()))
        yield Message(
            "note: {n} of {all} workers, such as {worker}, were started without {names}; workers of one machine"
            " then hold one another up",
            *(len(wrong), len(found), printable(worker), " ".join(f"{name}=1" for name in names)),
        )


def _row(task: Task, ended: Any) -> BatchRow:
    """The row of a task that has ended, also where only the results are there; a failed row where they are not."""
    if ended.status == "finished":
        try:
            return BatchRow.of(ended.result())
        except Exception as error:  # the connection was lost after it
            log.debug("a row did not come: %s", error)
    if (row := row_done(task)) is not None:
        return row
    raised = ended.exception() if ended.status == "error" else None
    why = f"{type(raised).__name__}: {raised}" if raised else f"no result arrived ({ended.status})"
    words = Message("the cluster gave it up: {why}", printable(why)[:300])
    return failed(task.title, task.source, words, 1)
