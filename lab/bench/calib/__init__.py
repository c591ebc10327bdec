"""Calibration beside its baselines."""
