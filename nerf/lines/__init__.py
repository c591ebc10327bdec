"""Take contour lines off the drawings."""
