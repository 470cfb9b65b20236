"""The operator's hand: ``orders`` are what can be asked of a run, ``keyboard`` gives them from a terminal.

``tare`` says when a tare needs to be ordered twice.
"""

from live.operate.keyboard import listen
from live.operate.orders import Orders, carry_out
from live.operate.tare import FORCED, UNDO, TareOrders

__all__ = ["FORCED", "UNDO", "Orders", "TareOrders", "carry_out", "listen"]
