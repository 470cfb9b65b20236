"""From one picture to the next, in compiled loops: import its modules by name.

``search``, ``block_match`` and ``hill_climb`` find whole pixels, ``prediction`` the place of a ZOI in the next frame,
``renewal`` places a new reference on the first.
"""
