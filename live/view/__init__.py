"""The view in rerun: maps, curves, pictures, events.

``rerun_view`` joins it: a ``publisher`` thread for each place that is drawn to, a ``scene`` that says what
is drawn (``shapes``, ``marks``, ``curve``, ``curve_drawing``, ``thinned``) as ``setup`` and ``layout`` say;
``viewer`` finds rerun's program.
"""

from live.view.rerun_view import RerunView
from live.view.setup import ViewSetup
from live.view.viewer import rerun_command, spawn_viewer

__all__ = ["RerunView", "ViewSetup", "rerun_command", "spawn_viewer"]
