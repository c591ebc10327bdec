"""Prepare drawings for training: registration, unwarping, symmetry, view coverage."""
