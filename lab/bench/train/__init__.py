"""Trainings: methods, switches, their cost."""
