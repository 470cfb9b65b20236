"""A history that never grows beyond its bound: when full, every second item goes."""

from __future__ import annotations

from typing import Generic, TypeVar

Item = TypeVar("Item")


class Thinned(Generic[Item]):
    """Evenly thinned past, and always the newest item.

    Parameters
    ----------
    most : int
        Items kept, at most (and one more, the newest).
    """

    def __init__(self, most: int) -> None:
        self._most, self._kept = most, list[Item]()
        self._newest: list[Item] = []
        self._stride, self._since = 1, 0

    def append(self, item: Item) -> None:
        """Add the newest."""
        self._newest = [item]
        self._since += 1
        if self._since < self._stride:
            return
        self._since, self._newest = 0, []
        self._kept.append(item)
        if len(self._kept) > self._most:
            # The newest stays: it is the first of those that follow.
            self._kept, self._stride = self._kept[::-2][::-1], 2 * self._stride

    @property
    def newest(self) -> Item:
        """The last one added."""
        return (self._newest or self._kept)[-1]

    def items(self) -> list[Item]:
        """Oldest first."""
        return self._kept + self._newest
