"""The operator's hand: ``orders`` are what can be asked of a run in one line, ``keyboard`` gives them from a terminal
(``keys`` are single ones), ``port`` from other programs.

``tare`` says when a tare needs to be ordered twice, ``refusal`` why an order is not carried out.
"""

from live.operate.keyboard import listen
from live.operate.orders import ENDED, START, STOP, WORDS, Orders, answer
from live.operate.port import OrderPort
from live.operate.refusal import OrderRefused
from live.operate.tare import FORCED, UNDO, TareOrders

__all__ = [
    "ENDED",
    "FORCED",
    "START",
    "STOP",
    "UNDO",
    "WORDS",
    "OrderPort",
    "OrderRefused",
    "Orders",
    "TareOrders",
    "answer",
    "listen",
]
