"""One closing for all devices and files."""

from __future__ import annotations

import pytest

from acquire.closing import Closing


class Thing(Closing):
    closed = 0

    def close(self) -> None:
        self.closed += 1


def test_with_gives_the_thing_itself_and_closes_it() -> None:
    with Thing() as thing:
        assert thing.closed == 0
    assert thing.closed == 1


def test_an_error_inside_closes_and_comes_through() -> None:
    thing = Thing()
    with pytest.raises(LookupError), thing:
        raise LookupError
    assert thing.closed == 1


def test_what_cannot_be_closed_cannot_be_made() -> None:
    with pytest.raises(TypeError, match="close"):
        type("Open", (Closing,), {})()
