"""How loops are compiled (``loops``), and the vector instructions they say outright (``vectors``): numba."""
