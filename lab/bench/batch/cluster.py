"""A Ray cluster on this machine."""

from typing import Any


def make_cluster() -> Any:
    """Return a cluster of two nodes of one core each."""
    from ray.cluster_utils import Cluster

    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1})
    cluster.add_node(num_cpus=1)
    return cluster
