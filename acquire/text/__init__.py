"""Texts for people: ``message`` keeps what is said apart from what is filled in, ``quantity`` prints numbers."""

from acquire.text.message import Message, about, joined, meant, word
from acquire.text.quantity import Amount, counts

__all__ = ["Amount", "Message", "about", "counts", "joined", "meant", "word"]
