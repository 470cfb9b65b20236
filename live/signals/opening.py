"""The signals that a configuration asks for, as consumers of a live run."""

from __future__ import annotations

from live.channels import Readings
from live.outputs import About, Consumer
from live.signals.watch import AlarmWatch
from live.tell import Books


def signals_of(about: About, books: Books) -> list[Consumer]:
    """Alarms."""
    config = about.config
    if not config.alarm:
        return []
    watch = AlarmWatch(
        config.alarm, _readings(about, books), books.vitals.channels, books.alarms, books.journal
    )
    return [watch]


def _readings(about: About, books: Books) -> Readings:
    specimen = about.config.specimen
    return Readings(about.start.monotonic, specimen.axis, specimen.area_m2, lambda: books.loads.latest)
