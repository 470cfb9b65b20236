"""numba: how loops are compiled (``loops``), and their threads: what each does (``shares``), on which core (``cores``)
and in which process they are (``forked``). The vector instructions that loops say outright (``vectors``,
``convolution``).
"""
