"""Decode and encode pictures safely."""
