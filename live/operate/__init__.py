"""The operator's hand: ``orders`` are what can be asked of a run, ``keyboard`` gives them from a terminal."""

from live.operate.keyboard import listen
from live.operate.orders import Orders, carry_out

__all__ = ["Orders", "carry_out", "listen"]
