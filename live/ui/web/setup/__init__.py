"""Set-up on the page: devices, live picture, region, gauges, scale, and the check of the still specimen.

``setup_session`` joins the parts: ``camera_preview`` and ``load_preview`` read the devices of a ``config_draft``,
which finds others too; ``specimen_region`` holds the region as drawn, ``specimen_check`` judges the newest
frames. ``draft_changes`` has the requests of the page.
"""
