"""Splitting of messy sheets."""
