"""The view in rerun: maps, curves, pictures, events, drawn by a process of its own.

``view`` is what the test gives to; ``waiting`` keeps it, ``supply`` makes messages of it (the room ``exchange``),
``keeper`` keeps a ``child`` alive and sends them to it. That child is the room ``drawing``: rerun is loaded
there alone. ``viewer`` finds rerun's program.
"""

from live.view.exchange.setup import ViewSetup
from live.view.view import View
from live.view.viewer import has_display, rerun_command, spawn_viewer

__all__ = ["View", "ViewSetup", "has_display", "rerun_command", "spawn_viewer"]
