"""Many tests replayed by workers.

``listed`` says which tests there are; ``work`` is what is done with one of them, ``workers`` who does it, ``course``
what follows what, with long sessions cut into chunks (``cutting``); ``campaign`` puts it together with its
``standing``, and ``summary`` writes the table.
"""

from live.batch.campaign import Campaign, Wanted, run_campaign
from live.batch.listed import Listed, find_tests

__all__ = [
    "Campaign",
    "Listed",
    "Wanted",
    "find_tests",
    "run_campaign",
]
