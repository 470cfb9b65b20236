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

    Attributes
    ----------
    kept : list
        Every ``2**halvings``-th item from the first on, oldest first.
    halvings : int
        How often every second item went.
    """

    def __init__(self, most: int) -> None:
        self._most, self._count = most, 0
        self.kept, self.halvings = list[Item](), 0
        self._newest: list[Item] = []

    def append(self, item: Item) -> None:
        """Add the newest."""
        self._newest = [item]
        if self._count % (1 << self.halvings) == 0:
            self.kept.append(item)
            if len(self.kept) > self._most:
                self.kept, self.halvings = self.kept[::2], self.halvings + 1
        self._count += 1

    def items(self) -> list[Item]:
        """Oldest first, the newest always among them."""
        is_kept = (self._count - 1) % (1 << self.halvings) == 0
        return self.kept + self._newest * (not is_kept)
