"""``python -m live.ui.rerun.drawing``: the process that draws a test with rerun.

``process`` reads messages, ``scene`` draws them (with ``shapes`` and the curve and large figures of ``layout``)
into one or two ``sinks``: a server behind a proxy, and a file.
"""
