"""Detect drawings that are cropped, stretched, or have false holes."""
