"""Before a test: devices, region, scale, gauges, compiling, and the check.

``devices`` opens camera and load cell (the only module that opens simulated ones). ``region`` finds the specimen,
``grid`` places ZOIs and gauges on it, ``rig_proposal`` makes a rig file of both. ``scale`` measures mm per px,
``pictures`` reads frames, mask, dark and flat. ``compiling`` compiles ahead, ``dry_run`` runs
everything once. ``prepared`` has what is fixed before the first measurement. ``check`` judges the picture.
"""
