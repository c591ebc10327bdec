"""What eyes see on views between drawings: outlines, fragments, features, steadiness, size."""
