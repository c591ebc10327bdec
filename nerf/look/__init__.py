"""Render the drawn look: contour lines, and new views blended from the drawings over the field."""
