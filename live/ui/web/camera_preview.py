"""The live picture during set-up: a thread reads the camera and keeps the last frames."""

from __future__ import annotations

import contextlib
import logging
import queue
import threading
import time
from collections import deque
from collections.abc import Callable

from acquire.camera import Camera
from acquire.errors import DataError, PhasedicError
from acquire.events import Event
from acquire.frame import CameraInfo, Frame
from acquire.printable import brief, printable
from live.pipeline.latency import OUTPUT, lower_priority
from live.setup.devices import at_rest, open_rig
from live.ui.web.config_draft import ConfigDraft

log = logging.getLogger(__name__)

RECENT = 8
"""Frames kept."""

RETRY_S, OPEN_S = 1.0, 20.0
"""Delay before the camera is opened again; time limit for opening it."""


class CameraPreview:
    """Reads the camera of ``draft``, and opens it again where it fails.

    Parameters
    ----------
    draft : ConfigDraft
    on_open : callable taking a CameraInfo
        Called before the first frame of a camera.
    on_frame : callable taking a Frame, giving monotonic s
        Called with the newest frame; returns when to be called again.

    Attributes
    ----------
    info : CameraInfo or None
    trouble : str
        The fault of the camera; empty while it delivers frames.
    """

    def __init__(
        self, draft: ConfigDraft, on_open: Callable[[CameraInfo], None], on_frame: Callable[[Frame], float]
    ) -> None:
        self._draft, self._on_open, self._on_frame = draft, on_open, on_frame
        self.info: CameraInfo | None = None
        self.trouble = ""
        self._camera: Camera | None = None
        self._recent: deque[Frame] = deque(maxlen=RECENT)
        self._collected: deque[Frame] | None = None
        self._opened: queue.SimpleQueue[PhasedicError | None] = queue.SimpleQueue()
        self._lock = threading.Lock()
        self._closing, self._reopen = threading.Event(), threading.Event()
        self._thread = threading.Thread(target=self._work, name="page-camera", daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def close(self) -> None:
        """Close the camera and end the thread."""
        self._closing.set()
        self._stop()
        self._thread.join()

    def reopen(self, address: str) -> None:
        """Open the camera with another address; where that fails, raise and keep the old address."""
        before = self._draft.config.camera.address
        self._draft.change_all({"camera.address": address})
        self._opened = queue.SimpleQueue()
        self._reopen.set()
        self._stop()
        with contextlib.suppress(queue.Empty):
            if (error := self._opened.get(timeout=OPEN_S)) is not None:
                self._draft.change_all({"camera.address": before})
                raise error

    def recent(self) -> list[Frame]:
        """The last frames of this camera."""
        with self._lock:
            return list(self._recent)

    def collect(self, n: int) -> None:
        """Keep the next ``n`` frames."""
        with self._lock:
            self._collected = deque(maxlen=n)

    @property
    def collecting(self) -> bool:
        """Whether ``collect`` still waits for frames."""
        with self._lock:
            found = self._collected
            return found is not None and len(found) != found.maxlen

    def collected(self) -> list[Frame] | None:
        """The frames of ``collect`` once they are complete; they are returned once."""
        with self._lock:
            found = self._collected
            if found is None or len(found) != found.maxlen:
                return None
            self._collected = None
            return list(found)

    def _stop(self) -> None:
        camera = self._camera
        if camera is not None:
            camera.stop()

    def _work(self) -> None:
        lower_priority(OUTPUT)
        while not self._closing.is_set():
            try:
                self._preview()
            except PhasedicError as error:
                self.trouble = printable(brief(error))
            except Exception as error:
                log.exception("the preview of the camera failed")
                self.trouble = f"a defect: {error!r}"
            if self.trouble and not self._reopen.is_set():
                self._closing.wait(RETRY_S)

    def _preview(self) -> None:
        self._reopen.clear()
        config = self._draft.config.camera
        if not config.address:
            raise DataError(
                "no camera is given: start with --camera ADDRESS (phasedic devices lists the cameras)"
            )
        try:
            rig = open_rig(at_rest(config.address), "none:", self._on_event, crop=config.crop)
        except PhasedicError as error:
            self._opened.put(error)
            raise
        try:
            self._camera_opened(rig.camera)
            with rig.camera:
                self._drain(rig.camera)
        finally:
            self._camera = None
            rig.close()

    def _camera_opened(self, camera: Camera) -> None:
        with self._lock:
            self._camera, self.info = camera, camera.info
            self._recent.clear()
            self._collected = None
        self._on_open(camera.info)
        self._opened.put(None)

    def _drain(self, camera: Camera) -> None:
        due = 0.0
        for frame in camera:
            if self._closing.is_set() or self._reopen.is_set():
                return
            if not frame.damaged:
                self._keep(frame)
            if time.monotonic() >= due:
                due = self._on_frame(frame)

    def _keep(self, frame: Frame) -> None:
        self.trouble = ""
        with self._lock:
            self._recent.append(frame)
            if self._collected is not None and len(self._collected) != self._collected.maxlen:
                self._collected.append(frame)

    def _on_event(self, event: Event) -> None:
        if event.level != "info":
            self.trouble = printable(brief(event.text))
