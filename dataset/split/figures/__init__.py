"""Figures from marks: connected blobs, groups of them, letters and swatches among them."""
