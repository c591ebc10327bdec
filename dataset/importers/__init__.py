"""Import other programs' cameras and pictures as bundles."""
