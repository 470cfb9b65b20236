"""The strain guard: tells when small strains are no longer what they are taken for.

A rotation by r changes small strains by r^2/2 (0.5 degrees: 40 um/m; 3 degrees: 1400 um/m), a strain e by about
e^2/2 against the other measures (2 %: 200 um/m).
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from acquire.events import Event, EventKind, EventSink

if TYPE_CHECKING:
    from analysis.field import Measure, StrainField

MOST_ROTATION, MOST_STRAIN = math.radians(0.5), 0.02


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
