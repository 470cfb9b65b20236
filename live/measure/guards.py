"""What warns of measurements that are not what they are taken for.

Motion v during T multiplies the contrast at wave number k by |sinc(k v T / 2)|; up to 0.05 px that is
nothing. The motion itself is estimated with each burst (``acquire.burst.smear``). A rotation by r changes small
strains by r^2/2 (0.5 degrees: 40 um/m; 3 degrees: 1400 um/m), a strain e by about e^2/2 against the other
measures (2 %: 200 um/m).
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from acquire.burst import LIMIT_PX
from acquire.events import Event, EventKind, EventSink, Level
from acquire.frame import Burst

if TYPE_CHECKING:
    from analysis.field import Measure, StrainField

MOST_ROTATION, MOST_STRAIN = math.radians(0.5), 0.02


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


class StrainGuard:
    """Looks at each field of small strains, and warns once where another measure says more.

    Parameters
    ----------
    measure : str
        Of the strains that are reported; only small ones are looked at.
    on_event : callable taking an Event
    """

    def __init__(self, measure: Measure, on_event: EventSink) -> None:
        self._on_event, self._told = on_event, measure != "small"

    def look(self, field: StrainField, t: float) -> None:
        """Take note of a field, measured at ``t`` (s)."""
        if self._told or not field.ok.any():
            return
        turned = abs(float(np.nanmedian(field.rotation)))
        strained = max(abs(float(np.nanmedian(values))) for values in (field.du_dx, field.dv_dy))
        if turned > MOST_ROTATION or strained > MOST_STRAIN:
            self._told = True
            text = (
                f"turned by {math.degrees(turned):.1f} degrees, strained by {strained:.1%}: small strains are off by"
                f" about {(turned**2 + strained**2) / 2 * 1e6:.0f} um/m; measure with --strain engineering"
            )
            data = {"rotation": turned, "strain": strained}
            self._on_event(Event(t, EventKind.MEASUREMENT, "strain", text, "warning", data))
