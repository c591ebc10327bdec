"""A run on disk: write, read, watch."""
