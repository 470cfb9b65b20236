"""A recorded test, written and read.

``writer`` (with ``rotation`` and ``bursts``) writes ``session.h5`` as ``layout`` lays it out and ``info``
describes it, ``reader`` (with ``part``) reads it back, ``devices`` plays it as a camera and a load cell,
``recover`` copies what a crash has left; ``python -m acquire.session`` is a first reading in a child process.
"""

from acquire.session.info import SessionInfo
from acquire.session.reader import Session
from acquire.session.recover import recover
from acquire.session.rotation import RotatingWriter
from acquire.session.writer import SessionWriter

__all__ = ["RotatingWriter", "Session", "SessionInfo", "SessionWriter", "recover"]
