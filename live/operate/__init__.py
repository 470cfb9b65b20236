"""The operator's hand: ``orders`` are what can be asked of a run, ``keyboard`` gives them from a terminal."""

from live.operate.keyboard import listen

__all__ = ["listen"]
