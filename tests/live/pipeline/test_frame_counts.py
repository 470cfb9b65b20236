"""Every frame is counted once for measuring and once for recording; anything else is noticed."""

from __future__ import annotations

import pytest

from live.pipeline.run_state import FrameCounts

SOUND = {"grabbed": 100, "recorded": 90, "unrecorded": 4, "thinned": 6,
         "reference": 8, "measured": 60, "skipped": 30, "left_out": 2}  # fmt: skip


def test_they_add_up() -> None:
    assert FrameCounts(**SOUND).adds_up
    assert FrameCounts(
        **{**SOUND, "recorded": 0, "unrecorded": 0, "thinned": 0}
    ).adds_up  # nothing is recorded


@pytest.mark.parametrize("name", SOUND)
@pytest.mark.parametrize("more", [1, -1])
def test_one_frame_too_many_or_too_few(name: str, more: int) -> None:
    counts = FrameCounts(**SOUND)
    counts.add(**{name: more})
    assert not counts.adds_up and "NOT EVERY FRAME IS ACCOUNTED FOR" in counts.line()


@pytest.mark.parametrize(
    ("counts", "loss"), [({"lost": 1}, True), ({"unrecorded": 1}, True), ({"skipped": 9}, False)]
)
def test_what_is_missing_for_good(counts: dict[str, int], loss: bool) -> None:
    assert FrameCounts(**counts).loss is loss


def test_the_share_that_was_not_measured() -> None:
    assert FrameCounts(**SOUND).skipped_share == pytest.approx(1 / 3)
    assert FrameCounts().skipped_share == 0
