"""Mesh files: read, check, write."""
