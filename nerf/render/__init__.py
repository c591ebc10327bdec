"""Render a field: views, layers, turntables, animations."""
