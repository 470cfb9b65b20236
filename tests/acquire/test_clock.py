"""The two clocks, and the text between them."""

from __future__ import annotations

import time
from datetime import UTC, datetime, timedelta, timezone

import pytest

from acquire.clock import ClockPair


def test_the_text_comes_back() -> None:
    pair = ClockPair(12.5, datetime(2026, 5, 9, 7, 35, 25, 123456, tzinfo=UTC))
    assert pair.iso() == "2026-05-09T07:35:25.123456Z"
    assert ClockPair.from_iso(12.5, pair.iso()) == pair


def test_other_zones_are_written_in_utc() -> None:
    zone = timezone(timedelta(hours=2))
    assert ClockPair(0.0, datetime(2026, 5, 9, 9, 0, tzinfo=zone)).iso() == "2026-05-09T07:00:00.000000Z"


def test_now_is_now() -> None:
    before = time.monotonic()
    pair = ClockPair.now()
    assert before <= pair.monotonic <= time.monotonic()
    assert pair.utc.tzinfo is UTC


def test_what_is_no_time_is_refused() -> None:
    with pytest.raises(ValueError):
        ClockPair.from_iso(0.0, "yesterday")
