"""Measure what else tells cameras apart: face, texture, coherence of the silhouettes."""
