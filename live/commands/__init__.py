"""The commands, one module each. ``arguments`` lists them, ``options`` has the options that set keys of the
configuration.
"""
