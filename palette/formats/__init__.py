"""Palette files of this and other programs."""
