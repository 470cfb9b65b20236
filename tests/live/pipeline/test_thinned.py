"""A thinned list is bounded and even, and has the newest item."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from live.pipeline.queues import Thinned


@given(size=st.integers(2, 30), count=st.integers(0, 500))
def test_evenly_thinned_from_the_first_to_the_newest(size: int, count: int) -> None:
    history: Thinned[int] = Thinned(size)
    for item in range(count):
        history.append(item)
    stride = 2**history.halvings
    assert history.kept == list(range(0, count, stride))
    assert len(history.kept) <= size and (stride == 1 or len(history.kept) > size // 2 - 1)
    items = history.items()
    assert items[-1:] == ([count - 1] if count else []) and len(set(items)) == len(items)


@pytest.mark.parametrize("size", [4, 5])
def test_what_is_kept_stays_until_the_next_halving(size: int) -> None:
    history: Thinned[int] = Thinned(size)
    before: tuple[int, list[int]] = (0, [])
    for item in range(100):
        history.append(item)
        halvings, kept = before
        assert history.halvings > halvings or history.kept[: len(kept)] == kept
        before = history.halvings, list(history.kept)


def test_a_thinned_list_keeps_every_so_many_th_and_the_newest() -> None:
    kept: Thinned[int] = Thinned(4)
    course = []
    for k in range(10):
        kept.append(k)
        course.append(kept.items())
    assert course[3:6] == [[0, 1, 2, 3], [0, 2, 4], [0, 2, 4, 5]]
    assert course[8:] == [[0, 4, 8], [0, 4, 8, 9]] and kept.halvings == 2
