"""The operator's page: set-up, test and result in the browser of the rig.

``page_controller`` switches between the stages. Set-up: ``setup_session``, ``camera_preview``, ``check_panel``,
``drawn_region``, ``config_draft`` and ``draft_changes``. Run: ``page_consumer``. ``server`` answers requests
that ``authorization`` admits, ``broadcaster`` sends messages to open pages. The files of the page are in static.
"""
