"""Is the picture good enough, before the specimen is pulled?

``sample`` takes frames of the still specimen, ``check_list`` examines them, ``stillness`` and ``noise_floor``
measure motion and strain noise, ``verdict`` gives GO or NO-GO with advice. ``quick_check`` repeats it several
times a second.
"""
