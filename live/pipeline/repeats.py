"""Events that come again and again: counted, and kept once."""

from __future__ import annotations

import re
from collections.abc import Iterator

from acquire.events import Event, EventKind

AS_THEY_COME = 3
"""So many events alike are kept one by one; of those that follow the newest alone, with their number."""
MAX_KINDS = 1000
_COUNTED = {
    EventKind.ALARM, EventKind.LOST, EventKind.DEVICE, EventKind.RECORDER, EventKind.MEASUREMENT, EventKind.VIEW,
}  # fmt: skip
"""Not commands, references and the operator's words, each of which stands for itself."""
_NUMBER = re.compile(r"(?<![\w.])\d[\d.,\u202f]*(?!\w)")  # not that of a name: a3.png and a4.png are two

Likeness = tuple[str, ...]


def likeness(event: Event) -> Likeness:
    """What events that are counted together have in common: all but the numbers in their texts."""
    return (event.kind.value, event.source, event.level, _NUMBER.sub("#", event.text))


class Repeats:
    """Events in the order of the newest of each kind; what is kept is bounded, however many come."""

    def __init__(self) -> None:
        self._kept: dict[int, tuple[Event, int]] = {}
        self._seen: dict[Likeness, tuple[int, int]] = {}
        self._number = 0

    def add(self, event: Event) -> int:
        """Keep an event; how many of its like there are with it."""
        self._number += 1
        count = 1
        if event.kind in _COUNTED:
            alike = likeness(event)
            if len(self._seen) >= MAX_KINDS and alike not in self._seen:
                alike = alike[:3]
            count, last = self._seen.get(alike, (0, 0))
            count += 1
            if count > AS_THEY_COME + 1:
                del self._kept[last]
            self._seen[alike] = (count, self._number)
        self._kept[self._number] = (event, count if count > AS_THEY_COME else 1)
        return count

    def __iter__(self) -> Iterator[tuple[Event, int]]:
        """Each event that is kept, and how many there were: 1, or all of its like up to this, the newest."""
        return iter(list(self._kept.values()))
