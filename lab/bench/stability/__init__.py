"""Sweeps of what sheets and cameras may have wrong, and whether the tool says so."""
