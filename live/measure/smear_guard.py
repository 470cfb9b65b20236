"""The smear guard: tells when the picture moves too far while a burst is taken.

Motion v during T multiplies the contrast at wave number k by |sinc(k v T / 2)|; up to 0.05 px that is
nothing. The motion itself is estimated with each burst (``acquire.burst.smear``).
"""

from __future__ import annotations

from acquire.burst import LIMIT_PX
from acquire.events import Event, EventKind, EventSink, Level
from acquire.frame import Burst


class SmearGuard:
    """Looks at each measured burst, warns when smear begins and says when it ends.

    Parameters
    ----------
    on_event : callable taking an Event
    limit_px : float, px
    """

    def __init__(self, on_event: EventSink, limit_px: float = LIMIT_PX) -> None:
        self._on_event, self._limit = on_event, limit_px
        self._smeared = False

    def look(self, burst: Burst) -> None:
        """Take note of a burst; one whose motion is not known changes nothing."""
        smeared = burst.motion_px > self._limit
        # What hovers about the limit is not told again and again.
        calm = burst.motion_px < 0.8 * self._limit
        if smeared and not self._smeared:
            text = (
                f"the picture moves {burst.motion_px:.2f} px during a burst of {burst.n}; take shorter bursts"
            )
            self._tell(burst, text, "warning")
        elif calm and self._smeared:
            self._tell(burst, "the picture stands still enough again during a burst", "info")
        self._smeared = smeared or (self._smeared and not calm)

    def _tell(self, burst: Burst, text: str, level: Level) -> None:
        data = {"motion_px": burst.motion_px, "n": burst.n}
        self._on_event(Event(burst.t, EventKind.MEASUREMENT, "burst", text, level, data))
