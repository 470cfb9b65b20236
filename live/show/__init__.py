"""A finished run in the view: made from its files, drawn by the process that draws a running one.

``story`` is what the view is told, ``showing`` opens the view and keeps it there.
"""

from live.show.showing import show
from live.show.story import Asked

__all__ = ["Asked", "show"]
