"""The accuracy of the measurement: the paper reproduced, other programs, or a pattern of the user.

``command`` runs the ``experiments`` and ``page`` writes their results; ``truth`` renders pictures of known truth,
``own_pattern`` and ``imposed`` characterise a picture of the user, ``inspect`` shows one ZOI of a session.
"""
