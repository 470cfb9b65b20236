"""How loops are compiled (``loops``), the vector instructions they say outright (``vectors``), and in which
process their threads are (``forked``): numba.
"""
