"""Colours in, a palette and labels out."""
