"""The frame counts of a run: every grabbed frame is accounted for, and the sums are checked."""

from __future__ import annotations

import threading
from dataclasses import dataclass, field, fields


@dataclass(slots=True)
class FrameCounts:
    """Counts of frames; ``add`` may be called from any thread.

    Attributes
    ----------
    grabbed : int
        Frames the camera handed out.
    recorded, unrecorded, thinned : int
        Written to the session; not written although they should be (a counted gap); left out on purpose: by
        the recording mode (only bursts, every K-th), or while recording was off.
    reference, measured, skipped, left_out : int
        Part of the reference burst; of a measured burst; of a burst that a newer one replaced or that
        came while measuring was paused; of no complete burst, or damaged.
    lost : int
        Frames that the camera or its connection lost.
    load_samples, load_lost : int
        Samples of the load cell; samples that were missing when the test ended.
    """

    grabbed: int = 0
    recorded: int = 0
    unrecorded: int = 0
    thinned: int = 0
    reference: int = 0
    measured: int = 0
    skipped: int = 0
    left_out: int = 0
    lost: int = 0
    load_samples: int = 0
    load_lost: int = 0
    _lock: threading.Lock = field(default_factory=threading.Lock, repr=False, compare=False)

    def add(self, **counts: int) -> None:
        """Add to the named counts."""
        with self._lock:
            for name, count in counts.items():
                setattr(self, name, getattr(self, name) + count)

    def as_dict(self) -> dict[str, int]:
        """The counts by name."""
        return {f.name: getattr(self, f.name) for f in fields(self) if not f.name.startswith("_")}

    @property
    def adds_up(self) -> bool:
        """Whether every grabbed frame is counted once for measuring, and once for recording where that was on."""
        used = self.reference + self.measured + self.skipped + self.left_out
        stored = self.recorded + self.unrecorded + self.thinned
        return used == self.grabbed and stored in (0, self.grabbed)

    @property
    def loss(self) -> bool:
        """Whether frames, or load samples at the end, are missing for good."""
        return self.lost > 0 or self.unrecorded > 0 or self.load_lost > 0

    @property
    def skipped_share(self) -> float:
        """Share of the frames after the reference that were not measured because measuring was late or paused."""
        return self.skipped / max(self.measured + self.skipped, 1)

    def line(self) -> str:
        """One line for a person."""
        on_purpose = f" and {self.thinned} on purpose" * (self.thinned > 0)
        share = f" ({self.skipped_share:.1%})" * (self.skipped > 0)
        load = f" / load samples lost {self.load_lost}" * (self.load_lost > 0)
        return (
            f"grabbed {self.grabbed} / recorded {self.recorded} / measured {self.measured}"
            f" / skipped {self.skipped}{share} / lost {self.lost}{load}"
            f"  (reference {self.reference}, left over {self.left_out}, not recorded {self.unrecorded}"
            f"{on_purpose}; {'adds up' if self.adds_up else 'DOES NOT ADD UP'})"
        )
