"""Sweeps of what a sheet may have wrong."""
