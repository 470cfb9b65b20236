"""``python -m live.ui.rerun.drawing``: the process that draws a test with rerun.

``process`` reads messages, ``scene`` draws them (with ``shapes``, ``curve``, ``large_figures`` and ``layout``)
into one or two ``sinks``: a server behind a ``proxy``, and a file.
"""
