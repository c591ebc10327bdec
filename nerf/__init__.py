"""Bundles to triplane radiance fields, renders and figures of merit."""
