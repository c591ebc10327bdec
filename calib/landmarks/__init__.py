"""Cameras from pairs of points and pixels."""
