"""The commands, one module each.

``arguments`` lists them. ``options`` has the options that set keys of the configuration, ``consumers`` the standard
consumers of a test. ``signals`` and ``streams`` are common to all commands.
"""
