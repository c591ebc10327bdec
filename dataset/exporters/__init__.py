"""Bundles for other programs."""
