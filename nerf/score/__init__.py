"""Score renderings beside pictures: metrics, tables, verdict."""
