"""Compute fast numerics: interpolation, compositing, decoder, losses, threads."""
