"""A recorded test, written and read.

``writer`` (with ``rotation`` and ``bursts``) writes ``session.h5`` as ``layout`` lays it out, ``reader``
(with ``part``) reads it back, ``devices`` plays it as a camera and a load cell, ``recover`` copies what a
crash has left; ``python -m acquire.session`` is a first reading in a child process.
"""

from acquire.session.reader import RotatingWriter, Session, SessionWriter
from acquire.session.recover import recover

__all__ = ["RotatingWriter", "Session", "SessionWriter", "recover"]
