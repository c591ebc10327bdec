"""Export bundles to other programs."""
