"""Learning on several machines: a Dask cluster holds the demonstrations, and statistics travel."""

from pilotfish.cluster.connection import connect
from pilotfish.cluster.data import ClusterPartitions, open_set

__all__ = ["ClusterPartitions", "connect", "open_set"]
