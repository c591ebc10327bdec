"""Label pixels: nearest paint, blends along borders, drawn lines."""
