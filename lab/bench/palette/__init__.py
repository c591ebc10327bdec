"""Palettes and labels beside other tools."""
