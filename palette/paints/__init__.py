"""Find a palette: count colours, cluster them, choose those that are paints."""
