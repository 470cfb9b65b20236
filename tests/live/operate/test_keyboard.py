"""The operator's keys: a line is an order, what is refused is told."""

from __future__ import annotations

import io

from live.operate import ENDED, listen
from live.tell import Screen
from tests.live.operate.test_orders import FakeLive


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_what_nobody_knows_is_answered_with_the_orders() -> None:
    live, screen = FakeLive(), io.StringIO()
    thread = listen(live, Terminal("\nx\nn\n?\n"), Screen(screen))
    assert thread is not None
    thread.join(5)
    assert live.calls == []
    lines = screen.getvalue().splitlines()
    assert lines[0].startswith("keys (with Enter)")
    assert [line.partition(":")[0] for line in lines[1:]] == ["no", "no", "ok"]


def test_only_a_terminal_is_listened_to() -> None:
    assert listen(FakeLive(), io.StringIO("q\n"), Screen(io.StringIO())) is None
    assert listen(FakeLive(), None, Screen(io.StringIO())) is None
    live = FakeLive()
    thread = listen(live, Terminal("q\n"), Screen(io.StringIO()))
    assert thread is not None
    thread.join(5)
    assert live.calls == [("stop", ENDED)]
