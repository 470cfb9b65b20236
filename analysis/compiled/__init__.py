"""numba: compiled ``loops``, their threading ``layer``, the cores of their ``threads``, and explicit vector
instructions (``vectors``).
"""
