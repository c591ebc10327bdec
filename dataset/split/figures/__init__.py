"""Group connected components into figures, with letters and swatches among them."""
