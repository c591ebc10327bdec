"""Measure how well clicked landmarks give cameras, alone and together with outlines."""
