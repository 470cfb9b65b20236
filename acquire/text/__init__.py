"""Texts for people: ``message`` keeps what is said apart from what is filled in, ``printable`` cleans one of others."""

from acquire.text.message import Message

__all__ = ["Message"]
