"""The configuration: keys with their checks, loading and overlay, the rig file.

``sections`` are the keys, ``values`` their checks, ``loading`` reads and overlays, ``gauges`` are the tables of
virtual gauges, ``rig_file`` changes a rig file and keeps its comments, ``channels`` names what alarms and
outputs can use.
"""
