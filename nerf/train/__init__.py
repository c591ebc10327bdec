"""Fit a field to the drawings."""
