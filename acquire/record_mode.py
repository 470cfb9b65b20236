"""What of a test is recorded: every frame, every K-th, or bursts, all or of some cycles; the picture or a part."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any, Literal, Self

from numpy.typing import NDArray

from acquire.errors import ConfigError
from acquire.text import Message

Crop = tuple[int, int, int, int]
RECORD_MODES = Message("'all', 'bursts', 'every=K' or 'cycles=K' with K from 1")
_NUMBERED = re.compile("(every|cycles)=([1-9][0-9]{0,8})")


@dataclass(frozen=True, slots=True)
class RecordMode:
    """What is recorded.

    Attributes
    ----------
    kind : "all" | "bursts" | "every"
        Bursts: their exact sums instead of frames; a replay measures the same to the last bit.
    every : int
        Of "every": each so many-th frame.
    crop : (x, y, width, height) or None, px
        Part of the picture.
    cycles : int
        Of "bursts": those at valley and peak of cycles 1 to ``cycles``, then of every 10th to ten times as many, of
        every 100th to a hundred times, and so on; 0: all bursts.
    """

    kind: Literal["all", "bursts", "every"] = "all"
    every: int = 1
    crop: Crop | None = None
    cycles: int = 0

    @classmethod
    def parse(cls, text: str, crop: Crop | None = None) -> Self:
        """From ``all``, ``bursts``, ``every=K`` or ``cycles=K``.

        Raises
        ------
        ConfigError
        """
        if text == "all":
            return cls("all", 1, crop)
        if text == "bursts":
            return cls("bursts", 1, crop)
        found = _NUMBERED.fullmatch(text)
        if found and found[1] == "cycles":
            return cls("bursts", 1, crop, int(found[2]))
        if found:
            return cls("every", int(found[2]), crop)
        raise ConfigError(
            "record mode {text} is not possible; allowed: {RECORD_MODES}", repr(text), RECORD_MODES
        )

    def keeps(self, number: int) -> bool:
        """Whether the ``number``-th frame (from 0) of the test is recorded as a frame."""
        return self.kind != "bursts" and number % self.every == 0

    def keeps_cycle(self, number: int) -> bool:
        """Whether bursts of the cycle of this number, from 1, are recorded."""
        spacing = 1
        while number > self.cycles * spacing:
            spacing *= 10
        return number % spacing == 0

    def check(self, width: int, height: int) -> None:
        """Refuse a crop that leaves the picture.

        Raises
        ------
        ConfigError
        """
        if self.crop is None:
            return
        x, y, w, h = self.crop
        if x < 0 or y < 0 or w < 1 or h < 1 or x + w > width or y + h > height:
            raise ConfigError(
                "crop {x},{y},{w},{h} leaves the picture of {width} x {height} px; give x,y,width,height within it",
                x,
                y,
                w,
                h,
                width,
                height,
            )

    def cut(self, image: NDArray[Any]) -> NDArray[Any]:
        """The part of a picture that is recorded."""
        if self.crop is None:
            return image
        x, y, w, h = self.crop
        return image[y : y + h, x : x + w]

    def text(self) -> str:
        """As ``parse`` takes it."""
        if self.cycles:
            return f"cycles={self.cycles}"
        return f"every={self.every}" if self.kind == "every" else self.kind
