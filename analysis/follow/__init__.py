"""From one picture to the next, in compiled loops: import its modules by name.

``start`` and ``climb`` search whole pixels (``search`` joins them), ``alpha_beta`` and ``prediction`` say
where a ZOI will be, ``renewal`` places a new reference on the first.
"""
