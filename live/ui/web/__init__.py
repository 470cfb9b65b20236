"""The operator's page: set-up, test and result in the browser of the rig.

``page_controller`` switches between the stages. Before a test: ``setup``. Run: ``page_consumers``, with a
``page_consumer`` for each camera, its ``map_view`` and ``run_panels``. After it: ``run_result``. ``server`` answers
requests that ``authorization`` admits, ``broadcaster`` sends messages to open pages. The files of the page are in
static.
"""
