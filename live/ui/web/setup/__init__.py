"""Set-up on the page: devices, live picture, region, gauges, scale, and the check of the still specimen.

``setup_session`` joins the parts: ``camera_preview`` and ``load_preview`` read the devices of a ``config_draft``,
``device_lists`` finds others, ``specimen_region`` holds the ``drawn_region``, ``specimen_check`` judges the newest
frames, ``check_panel`` shows its figures. ``draft_changes`` has the requests of the page.
"""
