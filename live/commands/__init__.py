"""The commands, one module each.

``arguments`` lists them. ``options`` has the options that set keys of the configuration, ``consumers`` the standard
consumers of a test, and its end. ``process`` has signals, environment and streams, common to all commands.
"""
