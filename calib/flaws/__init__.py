"""Drawings that are cropped, stretched, or have holes that are paint."""
