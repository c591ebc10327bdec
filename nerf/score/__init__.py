"""Score renderings against pictures: metrics, tables, verdict."""
