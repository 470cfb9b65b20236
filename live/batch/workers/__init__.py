"""Who does the work: ``pool`` has processes of this machine do it (``worker`` is their side), ``cluster`` a Dask
cluster (``there`` is what runs on it).
"""

from live.batch.workers.cluster import Cluster
from live.batch.workers.pool import Hands, Pool

__all__ = ["Cluster", "Hands", "Pool"]
