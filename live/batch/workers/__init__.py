"""Who does the work: ``pool`` has processes of this machine do it (``hands``), ``cluster`` a Dask cluster.

``worker`` is the side of such a process, ``there`` what runs on a cluster.
"""

from live.batch.workers.cluster import Cluster
from live.batch.workers.hands import Hands
from live.batch.workers.pool import Pool

__all__ = ["Cluster", "Hands", "Pool"]
