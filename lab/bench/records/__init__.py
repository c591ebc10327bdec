"""Records of figures, and the gate that compares them with the committed ones."""
