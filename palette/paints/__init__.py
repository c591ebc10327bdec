"""Find a palette: count colours, cluster them, select those that are paints."""
