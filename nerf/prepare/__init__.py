"""Make drawings agree before training: cameras, bends, symmetry, what no drawing shows."""
