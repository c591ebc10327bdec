"""Find the mannequin's occluding contour, and match it with a drawn outline."""
