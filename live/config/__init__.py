"""The configuration: keys with their checks, loading and overlay, the rig file.

``sections`` has the keys, ``values`` the checks of their values, ``loading`` reads files and applies overrides.
``gauges`` has the tables of virtual gauges. ``rig_file`` writes a rig file and keeps its comments. ``channels``
names the values that alarms and outputs can use. ``listen_address`` checks and opens the ports of servers.
"""
