"""The live force during set-up: a thread reads the load cell and keeps the last seconds."""

from __future__ import annotations

import logging
import math
import threading
import time
from collections import deque
from collections.abc import Iterator
from typing import Any

from acquire.addresses import parse_address
from acquire.clock import Clock
from acquire.errors import DataError, PhasedicError
from acquire.events import Event
from acquire.load_cell import LoadCell
from acquire.load_cell.check import ListenResult, LoadReport, report, stillness
from acquire.load_sample import LoadCellInfo, LoadSample
from acquire.system import lower_priority
from acquire.text import Message
from acquire.text.message import brief, printable
from live.pipeline.latency import OUTPUT
from live.pipeline.timed.figure import OLD_S
from live.setup.check.lines import CheckLine
from live.setup.devices import open_load
from live.ui.web.setup.config_draft import ConfigDraft

log = logging.getLogger(__name__)

KEPT_S, SHOWN_S = 5.0, 0.5
"""Of the samples: for noise and check, and for the force that is shown."""
SILENT_S, RETRY_S = OLD_S, 1.0
"""Silence that is a fault; delay before the load cell is opened again."""
NONE = "none:"


class LoadPreview:
    """Reads the load cell of ``draft``, and opens it again where it fails or another is chosen.

    Parameters
    ----------
    draft : ConfigDraft
    clock : callable giving monotonic seconds

    Attributes
    ----------
    info : LoadCellInfo or None
    """

    def __init__(self, draft: ConfigDraft, clock: Clock = time.monotonic) -> None:
        self._draft, self._clock = draft, clock
        self.info: LoadCellInfo | None = None
        self._cell: LoadCell | None = None
        self._tried, self._fault = "", ""
        self._samples: deque[LoadSample] = deque()
        self._opened_t = clock()
        self._zeros: list[float] = []
        self._lock = threading.Lock()
        self._closing, self._reopen = threading.Event(), threading.Event()
        self._thread = threading.Thread(target=self._work, name="page-load", daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def close(self) -> None:
        """Close the load cell and end the thread."""
        self._closing.set()
        self.reopen()
        self._thread.join()

    def reopen(self) -> None:
        """Open the load cell that the draft has now."""
        self._reopen.set()
        cell = self._cell
        if cell is not None:
            cell.stop()

    # -- zero -----------------------------------------------------------------------------------

    def tare(self) -> None:
        """Make the present force zero, for the test too; raises DataError where it is not known or not still."""
        samples = self._last(1.0)
        if not samples:
            raise DataError("not tared: there is no force; look at the load cell")
        found = stillness([s.t for s in samples], [s.force for s in samples])
        if not found.still:
            raise DataError("not tared: the force is not still; leave the specimen at rest")
        self._zeros.append(self._draft.config.load.zero_N)
        self._draft.change_all({"load.zero_N": found.mean_N})

    def undo_tare(self) -> None:
        """Restore the zero before; raises DataError without one."""
        if not self._zeros:
            raise DataError("there is no tare to undo")
        self._draft.change_all({"load.zero_N": self._zeros.pop()})

    # -- state ----------------------------------------------------------------------------------

    @property
    def address(self) -> str:
        """Address of the load cell; ``NONE`` for a test without one."""
        return self._draft.config.load.address

    @property
    def trouble(self) -> str:
        """The fault of the load cell; empty while it delivers, and without one."""
        if self.address == NONE or self._recorded:
            return ""
        with self._lock:
            last = self._samples[-1].t if self._samples else self._opened_t
        silent = self._clock() - last
        if self._fault or silent < SILENT_S:
            return self._fault
        return Message(
            "the load cell is silent for {silent:.0f} s: look at cable, power and settings", silent
        )

    def state(self) -> dict[str, Any]:
        """Force, noise, rate and zero as the page shows them."""
        samples, zero = self._last(KEPT_S), self._draft.config.load.zero_N
        shown = [s.force for s in self._last(SHOWN_S)]
        still = stillness([s.t for s in samples], [s.force for s in samples])
        seconds = samples[-1].t - samples[0].t if len(samples) > 1 else 0.0
        return {
            "address": self.address,
            "name": "" if self.info is None else printable(self.info.name),
            "force_N": math.fsum(shown) / len(shown) - zero if shown else None,
            "noise_N": still.noise_N,
            "rate": (len(samples) - 1) / seconds if seconds > 0 else None,
            "zero_N": zero,
            "trouble": self.trouble,
        }

    def report(self) -> LoadReport | None:
        """The check of the last seconds; None without a load cell, for a recorded one, and before it is open."""
        opened, info, now = self._tried, self.info, self._clock()
        if info is None or opened != self.address or opened == NONE or self._recorded:
            return None
        with self._lock:
            samples = tuple(self._samples)
        return report(ListenResult(samples, max(now - KEPT_S, self._opened_t), now), info)

    def lines(self, found: LoadReport | None) -> Iterator[CheckLine]:
        """What a check says beside the report ``found``: a recorded, missing or closed load cell, and none."""
        if self.address == NONE:
            yield CheckLine(
                "load cell", Message("none: force, stress and modulus are not measured"), measured=False
            )
        elif self._recorded:
            yield CheckLine("load cell", Message("recorded, with the pictures or for itself"), measured=False)
        elif self.trouble:
            yield CheckLine("load cell", self.trouble, False, "choose the load cell under Camera")
        elif found is None:
            yield CheckLine(
                "load cell", Message("not open yet"), False, "wait for the force, then check again"
            )

    @property
    def _recorded(self) -> bool:
        return parse_address(self.address).scheme == "session"

    def _last(self, seconds: float) -> list[LoadSample]:
        """The samples with a force of the last seconds."""
        first = self._clock() - seconds
        with self._lock:
            return [s for s in self._samples if s.t >= first and not math.isnan(s.force)]

    # -- the thread -----------------------------------------------------------------------------

    def _work(self) -> None:
        lower_priority(OUTPUT)
        while not self._closing.is_set():
            self._reopen.clear()
            try:
                self._read()
            except PhasedicError as error:
                self._fault = printable(brief(error))
            except Exception as error:
                log.exception("the preview of the load cell failed")
                self._fault = Message("the load cell failed: {error}", repr(error))
            self._cell = None
            if not self._closing.is_set():
                self._reopen.wait(RETRY_S)

    def _read(self) -> None:
        address = self.address
        with self._lock:
            self._samples.clear()
        self.info, self._opened_t = None, self._clock()
        # The fault of an address stands until its load cell is open, which is tried again and again.
        if address != self._tried:
            self._tried, self._fault = address, ""
        if address == NONE:
            self._reopen.wait()
            return
        before = self._fault
        cell = open_load(address, self._on_event, self._draft.config.camera.address or NONE)
        self._cell, self.info = cell, cell.info
        if self._fault == before:
            self._fault = ""
        with cell:
            self._take(cell)
        if self._recorded and not self._reopen.is_set():
            self._reopen.wait()

    def _take(self, cell: LoadCell) -> None:
        for sample in cell:
            if self._reopen.is_set():
                return
            with self._lock:
                self._samples.append(sample)
                while self._samples[0].t < sample.t - KEPT_S:
                    self._samples.popleft()
            if self._clock() - sample.t < SILENT_S:
                self._fault = ""

    def _on_event(self, event: Event) -> None:
        if event.level != "info":
            self._fault = printable(brief(event.text))
