"""numba: how loops are compiled (``loops``), and their threads: what each does (``shares``), on which core (``cores``),
in which process they are (``forked``) and under which lock they start (``start_lock``). The vector instructions that
loops say outright (``vectors``, ``convolution``).
"""
