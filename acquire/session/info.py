"""What a session says once, at its start: devices, time zero, configuration, and what is recorded."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self

from acquire.clock import ClockPair
from acquire.frame import CameraInfo
from acquire.load_sample import LoadCellInfo
from acquire.record_mode import RecordMode

MOST_BURST_FRAMES = 65536


@dataclass(frozen=True, slots=True, eq=False)
class SessionInfo:
    """The description of a recording.

    Attributes
    ----------
    camera : CameraInfo
    load : LoadCellInfo or None
    start : ClockPair
        The start of the test; ``time_s`` counts from here.
    config, metadata, versions : mapping of str to JSON value
    mode : RecordMode
        Part of the picture; whether frames or bursts are what the file is for.
    burst_frames : int
        Frames of the longest burst that will be written.
    set_id, part : str, int
        Of a rotated recording (``RotatingWriter``).
    """

    camera: CameraInfo
    load: LoadCellInfo | None
    start: ClockPair
    config: Mapping[str, Any]
    metadata: Mapping[str, Any]
    versions: Mapping[str, Any]
    mode: RecordMode = dataclasses.field(default_factory=RecordMode)
    burst_frames: int = MOST_BURST_FRAMES
    set_id: str = ""
    part: int = 0

    def cropped(self) -> Self:
        """The same with the camera as it is recorded: the part ``mode.crop`` of its picture.

        Raises
        ------
        ConfigError
            That part leaves the picture.
        """
        if self.mode.crop is None:
            return self
        self.mode.check(self.camera.width, self.camera.height)
        _, _, width, height = self.mode.crop
        return dataclasses.replace(self, camera=dataclasses.replace(self.camera, width=width, height=height))
