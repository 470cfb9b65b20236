"""What goes through a test: frames, bursts, load samples, events and measurements, each a record of the stream."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from acquire.burst import SummedBurst
from acquire.events import Event
from acquire.frame import Burst, Frame
from acquire.load_sample import LoadSample
from live.pipeline.measurement import Measurement
from live.pipeline.reference import ReferenceBurst

Role = Literal["plain", "reference"]
"""Of a frame or a burst: decided once, before it is published, so that all who take it agree."""
ALL = ""
"""In place of the name of a camera: the record is for every camera, as a load sample is."""


@dataclass(frozen=True, slots=True, eq=False)
class Matched:
    """A measurement whose force is final."""

    measurement: Measurement


@dataclass(frozen=True, slots=True)
class ReferenceWanted:
    """The next frames of the camera are to be a reference."""


@dataclass(frozen=True, slots=True)
class Waiting:
    """Between two bursts: ``words`` name what the measurement waits for; empty after a burst that came in time."""

    words: str


@dataclass(frozen=True, slots=True)
class CameraEnded:
    """The camera gives no more frames."""


@dataclass(frozen=True, slots=True)
class LoadEnded:
    """The load cell gives no more samples; ``error`` is what ended it, if anything."""

    error: Exception | None = None


Body = (
    Frame
    | Burst
    | SummedBurst
    | ReferenceBurst
    | LoadSample
    | Event
    | Measurement
    | Matched
    | ReferenceWanted
    | Waiting
    | CameraEnded
    | LoadEnded
)
"""What a record holds. ``Burst``: a mean, made only where it is recorded; ``SummedBurst``: what is measured."""


@dataclass(frozen=True, slots=True, eq=False)
class Record:
    """One thing that happened in a test.

    Attributes
    ----------
    camera : str
        The name of its camera; ``ALL`` for every one.
    body : Body
    role : "plain" or "reference"
        Of a frame or burst.
    """

    camera: str
    body: Body
    role: Role = "plain"
