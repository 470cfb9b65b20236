"""How well this measures: the paper reproduced, peers, or a pattern of your own.

``command`` runs the experiments (in ``experiments``) and ``page`` writes them down; ``truth`` renders what
is true, ``outcome`` is what an experiment finds, ``own_pattern`` and ``imposed`` judge a picture of the
user.
"""
