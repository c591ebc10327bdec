"""The visual hull: carve it, march through it, smooth it."""
