"""Outlines and masks: distances, coherence under cameras, displacement."""
