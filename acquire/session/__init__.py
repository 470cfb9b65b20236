"""A recorded test, written and read.

``writer`` writes ``session.h5`` in the ``layout``, ``reader`` reads it (``part`` by part), ``devices`` plays it
as camera and load cell, ``recover`` copies what a crash left. ``python -m acquire.session`` reads a file first
in a child process.
"""

from acquire.session.layout import SessionInfo
from acquire.session.reader import RotatingWriter, Session
from acquire.session.recover import recover
from acquire.session.writer import SessionWriter

__all__ = ["RotatingWriter", "Session", "SessionInfo", "SessionWriter", "recover"]
