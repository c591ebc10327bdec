"""Find the drawings' contour lines, and the depth steps that have one."""
