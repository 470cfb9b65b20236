"""Orders over TCP: the same words, answered in a line."""

from __future__ import annotations

import io
from pathlib import Path

import pytest

from acquire.errors import ConfigError
from acquire.events import EventKind
from live.operate import ENDED, OrderPort
from live.tell import TerminalScreen
from tests.live.lines.test_server import WORD, Caller
from tests.live.operate.test_orders import FakeLive


def test_orders_are_carried_out_and_answered() -> None:
    live, said = FakeLive(), io.StringIO()
    port = OrderPort("0", None, TerminalScreen(said))
    caller = Caller(port.open(live))
    asked = [caller.ask(line) for line in ("pause", "note slipped", "nonsense", "quit")]
    assert asked[:2] == ["ok", "ok"] and asked[2].startswith("no: ") and asked[3] == "ok"
    assert live.calls == [(EventKind.PAUSE, ""), (EventKind.NOTE, "slipped"), ("stop", ENDED)]
    assert "orders are taken at 127.0.0.1:" in said.getvalue()
    caller.close()
    port.close()
    port.close()


def test_beyond_this_machine_only_with_a_token(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="token_file"):
        OrderPort("0.0.0.0:0", None, TerminalScreen(io.StringIO()))
    path = tmp_path / "token"
    path.write_text(WORD)
    live = FakeLive()
    port = OrderPort("0.0.0.0:0", str(path), TerminalScreen(io.StringIO()))
    number = port.open(live)
    wrong = Caller(number)
    assert wrong.ask("quit").startswith("no: ")
    wrong.close()
    caller = Caller(number)
    assert [caller.ask(f"token {WORD}"), caller.ask("quit")] == ["ok", "ok"]
    assert live.calls == [("stop", ENDED)]
    caller.close()
    port.close()
