"""The live picture during set-up: a thread reads the camera and keeps the last frames."""

from __future__ import annotations

import logging
import queue
import threading
import time
from collections import deque
from typing import Protocol

from acquire.camera import Camera
from acquire.errors import DataError, DeviceError, PhasedicError
from acquire.events import Event
from acquire.frame import CameraInfo, Frame
from acquire.system import lower_priority
from acquire.text.message import brief, printable
from live.pipeline.latency import OUTPUT
from live.setup.pictures import camera_of
from live.ui.web.setup.config_draft import ConfigDraft

log = logging.getLogger(__name__)

RECENT = 8
"""Frames kept."""
MAX_BYTES = 400_000_000
"""Of the frames of a check."""

RETRY_S, OPEN_S = 1.0, 20.0
"""Delay before the camera is opened again; time limit for opening it."""
REDRAW_S = 0.2  # between pictures of a recording that stands still

Answers = queue.SimpleQueue[PhasedicError | None]


class CameraViewer(Protocol):
    """Whom the frames are for."""

    def opened(self, info: CameraInfo) -> None:
        """A camera is open; before its first frame."""

    def show(self, frame: Frame) -> float:
        """Show the newest frame; returns when to be called again, s, monotonic."""

    def frames_needed(self, info: CameraInfo) -> int:
        """Frames of a whole check."""


class CameraPreview:
    """Reads the camera of ``draft``, and opens it again where it fails.

    Of a recording (files, video, session) only the first frames are read: the specimen at rest.

    Parameters
    ----------
    draft : ConfigDraft
    viewer : CameraViewer

    Attributes
    ----------
    info : CameraInfo or None
    trouble : str
        The fault of the camera; empty while it delivers frames.
    """

    def __init__(self, draft: ConfigDraft, viewer: CameraViewer) -> None:
        self._draft, self._viewer = draft, viewer
        self.info: CameraInfo | None = None
        self.trouble = ""
        self._camera: Camera | None = None
        self._recent: deque[Frame] = deque(maxlen=RECENT)
        self._first: list[Frame] = []  # of a recording
        self._whole = False  # all frames that are needed of the recording are read
        self._collected: deque[Frame] | None = None
        self._opened: Answers = queue.SimpleQueue()
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
        """Open the camera with another address; where that fails, raise and keep the old address.

        Raises
        ------
        ConfigError, DeviceError, DataError
        """
        before = self._draft.config.camera.address
        self._draft.change_all({"camera.address": address})
        self._opened = queue.SimpleQueue()
        self._reopen.set()
        self._stop()
        try:
            error = self._opened.get(timeout=OPEN_S)
        except queue.Empty:
            error = DeviceError(
                "{brief}: not open within {OPEN_S:g} s; look at its cable and power", brief(address), OPEN_S
            )
        if error is not None:
            self._draft.change_all({"camera.address": before})
            raise error

    @property
    def known(self) -> CameraInfo:
        """What is known of the camera; raises DataError before it is open."""
        if self.info is None:
            raise DataError("the camera has given no picture yet")
        return self.info

    def recent(self, least: int = RECENT) -> list[Frame]:
        """The last frames of this camera, ``least`` to ``RECENT``, or all of a shorter recording; else none."""
        with self._lock:
            return list(self._recent) if len(self._recent) >= least or self._whole else []

    def collect(self) -> None:
        """Keep the next frames, as many as a whole check needs; the first ones of a recording."""
        needed = self._viewer.frames_needed(self.known)
        with self._lock:
            self._collected = deque(maxlen=max(needed, 1))
            if self._whole:
                self._collect_first()

    def _collect_first(self) -> None:
        """Collect the first frames of a recording for the check."""
        self._collected = deque(self._first, maxlen=len(self._first))

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
            self._reopen.clear()
            asked = self._opened  # an answer is for who asked before the camera was opened
            try:
                self._preview(asked)
            except PhasedicError as error:
                self._failed(error, asked)
            except Exception as error:
                log.exception("the preview of the camera failed")
                self._failed(DeviceError("the camera failed: {error}", repr(error)), asked)
            if self.trouble and not self._reopen.is_set():
                self._closing.wait(RETRY_S)

    def _failed(self, error: PhasedicError, asked: Answers) -> None:
        self.trouble = printable(brief(error))
        asked.put(error)

    def _preview(self, asked: Answers) -> None:
        config = self._draft.config.camera
        if not config.address:
            raise DataError("no camera is chosen: choose one under Camera")
        with camera_of(config.address, self._on_event, crop=config.crop) as camera:
            try:
                with self._lock:
                    self._camera, self.info = camera, camera.info
                    self._recent.clear()
                    self._first, self._whole, self._collected = [], False, None
                self._viewer.opened(camera.info)
                asked.put(None)
                with camera:
                    self._drain(camera)
            finally:
                self._camera = None

    @property
    def _over(self) -> bool:
        return self._closing.is_set() or self._reopen.is_set()

    def _drain(self, camera: Camera) -> None:
        due, most = 0.0, 0 if camera.info.live else self._viewer.frames_needed(camera.info)
        for frame in camera:
            if self._over:
                return
            if not frame.damaged:
                self._keep(frame, most)
            if time.monotonic() >= due:
                due = self._viewer.show(frame)
            if most and len(self._first) >= most:
                break
        if most:
            self._rest()

    def _keep(self, frame: Frame, most: int) -> None:
        self.trouble = ""
        with self._lock:
            self._recent.append(frame)
            if most:
                self._first.append(frame)
            elif self._collected is not None and len(self._collected) != self._collected.maxlen:
                self._collected.append(frame)

    def _rest(self) -> None:
        """Show the last frame of a recording until another camera is opened."""
        if not self._first:
            raise DataError("the recording has no picture that can be used")
        with self._lock:
            self._whole = True
            if self._collected is not None:  # asked for while they were read
                self._collect_first()
        due = 0.0
        while not self._over:
            if time.monotonic() >= due:
                due = self._viewer.show(self._first[-1])
            self._closing.wait(REDRAW_S)

    def _on_event(self, event: Event) -> None:
        if event.level != "info":
            self.trouble = printable(brief(event.text))
