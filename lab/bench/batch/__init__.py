"""Measure `toonset batch`: sheets per hour, what a batch costs beside its stages, its table."""
