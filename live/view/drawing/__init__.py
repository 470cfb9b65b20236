"""``python -m live.view.drawing``: the process that draws a test with rerun, told by ``live.view`` what.

``process`` reads messages and hands them to a ``scene`` (``shapes``, ``marks``, ``curve``, ``curve_drawing``,
``layout``), which draws into one or two ``places``: a server behind a ``door``,
and a file. ``guard`` watches over its memory and its parent.
"""
