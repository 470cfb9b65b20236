"""Many tests replayed by workers.

``listed`` says which tests there are, ``keys`` what a result depends on, ``task`` replays one of them into a
folder that takes its name when it is whole (``places``), ``row`` is what it tells; ``pool`` has processes of this
machine do that (``worker`` is their side), ``campaign`` puts it together with its ``standing``, and ``summary``
writes the table.
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
