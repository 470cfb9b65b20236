"""The check of picture and load cell before a test.

``sample`` takes frames of the still specimen, ``check_list`` computes all figures, ``stillness`` and ``noise_floor``
those of motion and strain noise. ``verdict`` compares them with limits and gives advice, in ``lines``.
``quick_check`` repeats the check several times a second.
"""
