"""numba: compiled ``loops``, their threading ``layer``, the cores of their ``threads``, explicit vector instructions
(``vectors``), and what ends them early (``interruption``).
"""
