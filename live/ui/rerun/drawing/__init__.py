"""``python -m live.ui.rerun.drawing``: the process that draws a test with rerun.

``process`` reads messages, ``scene`` draws them (``shapes``, ``curve``, ``board``, ``field_maps``, ``layout``)
into one or two ``sinks``: a server behind a ``proxy``, and a file.
"""
