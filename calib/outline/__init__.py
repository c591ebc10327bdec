"""The mannequin's occluding contour, and its correspondences with a drawn outline."""
