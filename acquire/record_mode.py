"""What of a test is recorded: every frame, every K-th, or only the bursts; the whole picture or a part."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any, Literal, Self

from numpy.typing import NDArray

from acquire.errors import ConfigError
from acquire.text import Message

Crop = tuple[int, int, int, int]
RECORD_MODES = Message("'all', 'bursts' or 'every=K' with K from 1")
_EVERY = re.compile("every=([1-9][0-9]{0,8})")


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
    """

    kind: Literal["all", "bursts", "every"] = "all"
    every: int = 1
    crop: Crop | None = None

    @classmethod
    def parse(cls, text: str, crop: Crop | None = None) -> Self:
        """From ``all``, ``bursts`` or ``every=K``.

        Raises
        ------
        ConfigError
        """
        if text == "all":
            return cls("all", 1, crop)
        if text == "bursts":
            return cls("bursts", 1, crop)
        every = _EVERY.fullmatch(text)
        if every:
            return cls("every", int(every[1]), crop)
        raise ConfigError(
            "record mode {text} is not possible; allowed: {RECORD_MODES}", repr(text), RECORD_MODES
        )

    def keeps(self, number: int) -> bool:
        """Whether the ``number``-th frame (from 0) of the test is recorded as a frame."""
        return self.kind != "bursts" and number % self.every == 0

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
        return f"every={self.every}" if self.kind == "every" else self.kind
