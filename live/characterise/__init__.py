"""How well this measures: the paper reproduced, peers, or a pattern of your own.

``command`` runs the ``experiments`` and ``page`` writes their results; ``truth`` renders what is true,
``own_pattern`` and ``imposed`` judge a picture of the user.
"""
