"""Before a test: devices, region, scale, gauges, compiling, and the check.

``devices`` opens camera and load cell (the only module that opens simulated ones), ``region`` finds the
specimen, ``placement`` and ``gauge_proposal`` place gauges, ``scale`` measures mm per px, ``grid`` places ZOIs,
``pictures`` reads mask, dark and flat frames, ``compiling`` compiles ahead.
"""
